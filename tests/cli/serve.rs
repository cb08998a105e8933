//! The server as a process: its one line, its token, its folder, its end.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use serde_json::{Value, json};

use super::{command, fixture, folder, prints, refused, small_scene};

/// A server that runs until it is told to end, or the test does.
struct Running {
    process: Child,
    /// The line that it printed.
    address: String,
    rest: BufReader<std::process::ChildStdout>,
}

impl Running {
    fn start(folder: &Path, more: &[&str]) -> Self {
        let mut command = command(folder, &["serve", "--adapter", "cpu"]);
        let mut process = command.args(more).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut rest = BufReader::new(process.stdout.take().unwrap());
        let mut address = String::new();
        rest.read_line(&mut address).unwrap();
        assert!(address.ends_with('\n'), "the server ended without a word");
        Self { process, address: address.trim_end().to_owned(), rest }
    }

    /// Host and port.
    fn host(&self) -> &str {
        self.address.strip_prefix("http://").unwrap().split('/').next().unwrap()
    }

    /// Status and body of the answer to a request.
    fn ask(&self, method: &str, path: &str, body: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(self.host()).unwrap();
        let (host, length) = (self.host(), body.len());
        write!(
            stream,
            "{method} {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\nContent-Type: application/json\r\n\
             Content-Length: {length}\r\n\r\n{body}"
        )
        .unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        let (head, body) = answer.split_once("\r\n\r\n").unwrap();
        (head.split(' ').nth(1).unwrap().parse().unwrap(), body.to_owned())
    }

    /// Sends a signal, and gives the exit code and what else was printed.
    fn end(mut self, signal: &str) -> (Option<i32>, String) {
        assert!(Command::new("kill").args([signal, &self.process.id().to_string()]).status().unwrap().success());
        let mut more = String::new();
        self.rest.read_to_string(&mut more).unwrap();
        (self.process.wait().unwrap().code(), more)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[test]
fn a_server_prints_its_address_and_ends_in_order_when_told_to() {
    let folder = folder();
    small_scene(folder.path(), &json!({}));
    for signal in ["-TERM", "-INT"] {
        let server = Running::start(folder.path(), &["--listen", "127.0.0.1:0", "--scene", "scene.json"]);
        assert!(server.address.starts_with("http://127.0.0.1:") && server.address.ends_with('/'), "{}", server.address);
        assert_eq!(server.ask("GET", "/healthz", "").0, 200);
        assert!(prints(folder.path(), &["healthcheck", "--url", &server.address]).is_empty());
        assert_eq!(server.end(signal), (Some(0), String::new()));
    }
}

#[test]
fn an_address_that_others_reach_comes_with_a_token() {
    let folder = folder();
    small_scene(folder.path(), &json!({}));
    let scene = ["--listen", "0.0.0.0:0", "--scene", "scene.json", "--base-path", "/lab"];
    let server = Running::start(folder.path(), &scene);
    let (address, token) = server.address.split_once("?token=").unwrap();
    assert!(address.starts_with("http://127.0.0.1:") && address.ends_with("/lab/") && token.len() >= 32, "{}", server.address);
    assert_eq!(server.ask("GET", "/lab/api/v1/info", "").0, 401);
    assert_eq!(server.ask("GET", &format!("/lab/api/v1/info?token={token}"), "").0, 200);
    drop(server);
    let open = Running::start(folder.path(), &[&scene[..], &["--no-auth"]].concat());
    assert!(open.address.ends_with("/lab/"), "{}", open.address);
    assert_eq!(open.ask("GET", "/lab/api/v1/info", "").0, 200);
}

#[test]
fn a_token_from_a_file_is_asked_for_and_not_printed() {
    let folder = folder();
    small_scene(folder.path(), &json!({}));
    std::fs::write(folder.path().join("token"), "open-sesame\n").unwrap();
    let server = Running::start(folder.path(), &["--listen", "127.0.0.1:0", "--scene", "scene.json", "--token-file", "token"]);
    assert!(server.address.ends_with('/'), "{}", server.address);
    assert_eq!(server.ask("GET", "/api/v1/info", "").0, 401);
    assert_eq!(server.ask("GET", "/api/v1/info?token=open-sesame", "").0, 200);
}

#[test]
fn a_server_reads_datasets_of_its_folder_and_the_paths_of_its_scene() {
    let folder = folder();
    std::fs::create_dir(folder.path().join("data")).unwrap();
    std::fs::copy(fixture("gzip_u1.nrrd"), folder.path().join("data/engine.nrrd")).unwrap();
    std::fs::copy(fixture("c_f4.npy"), folder.path().join("own.npy")).unwrap();
    let scene = json!({"volumes": {"main": {"source": {"type": "file", "path": "own.npy"}}}});
    std::fs::write(folder.path().join("scene.json"), scene.to_string()).unwrap();
    let server = Running::start(folder.path(), &["--listen", "127.0.0.1:0", "--scene", "scene.json", "--data", "data"]);
    let create = |source: Value| {
        let scene = json!({"volumes": {"main": {"source": source}}});
        server.ask("POST", "/api/v1/sessions", &json!({"scene": scene}).to_string())
    };
    assert_eq!(create(json!({"type": "file", "dataset": "engine.nrrd"})).0, 201);
    for source in [json!({"dataset": "gone.nrrd"}), json!({"dataset": "../own.npy"}), json!({"path": "own.npy"})] {
        let mut source = source;
        source["type"] = "file".into();
        let (status, problem) = create(source.clone());
        assert!((400..500).contains(&status) && problem.contains("volumes.main.source"), "{source}: {status} {problem}");
    }
}

#[test]
fn a_server_that_cannot_start_says_why() {
    let folder = folder();
    std::fs::write(folder.path().join("empty"), "\n").unwrap();
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let cases: [(&[&str], i32, &str); 8] = [
        (&["--listen", "nonsense"], 2, "--listen"),
        (&["--fps", "0"], 2, "--fps"),
        (&["--origin", "nonsense"], 2, "`nonsense` is no origin"),
        (&["--no-auth", "--token-file", "empty"], 2, "cannot be used with"),
        (&["--token-file", "gone"], 4, "gone: file: "),
        (&["--token-file", "empty"], 4, "empty: token: "),
        (&["--data", "gone"], 4, "gone: folder: "),
        (&["--listen", &address], 1, &address),
    ];
    for (args, code, words) in cases {
        let line = refused(folder.path(), &[&["serve"], args].concat(), code);
        assert!(line.contains(words), "{args:?}: {line:?} lacks {words:?}");
    }
}
