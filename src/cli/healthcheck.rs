//! Asks a running server whether it is well, for containers whose image holds no curl.

use std::io::{Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use super::failure::Failure;

/// Longest wait for each part of the conversation.
const PATIENCE: Duration = Duration::from_secs(3);

/// Ask a running server whether it is well: exit code 0 if so, 1 if not.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Address of the server, with its base path if it has one.
    #[arg(long, default_value = "http://127.0.0.1:8080")]
    url: String,
}

/// Asks for `/healthz`.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let url = args.url.trim_end_matches('/');
    let Some(rest) = url.strip_prefix("http://") else {
        return Err(Failure::usage(format!("--url: `{url}` does not start with http://")));
    };
    let (host, base) = rest.find('/').map_or((rest, ""), |at| rest.split_at(at));
    let has_port = host.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok());
    let address = if has_port { host.to_owned() } else { format!("{host}:80") };
    let status = ask(&address, host, base).map_err(|error| Failure::broken(format!("{url}: {error}")))?;
    // `HTTP/1.1 200 OK`
    match status.split_whitespace().nth(1) {
        Some("200") => Ok(()),
        _ => Err(Failure::broken(format!("{url}: the answer is `{status}`"))),
    }
}

/// The status line of the answer.
fn ask(address: &str, host: &str, base: &str) -> std::io::Result<String> {
    let nowhere = || std::io::Error::other("no such host");
    let address = address.to_socket_addrs()?.next().ok_or_else(nowhere)?;
    let mut stream = TcpStream::connect_timeout(&address, PATIENCE)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    write!(stream, "GET {base}/healthz HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n")?;
    let mut answer = Vec::new();
    stream.take(1024).read_to_end(&mut answer)?;
    Ok(String::from_utf8_lossy(&answer).lines().next().unwrap_or_default().to_owned())
}
