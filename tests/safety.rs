//! Who may use the server, and what a client that means harm gets.
#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::net::SocketAddr;
use std::time::Duration;

use serde_json::json;
use support::stream::{path, upgrade};
use support::{Client, ENGINE, PATIENCE, growing, start, start_with, still_cloud};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tyndall::server::{ServeConfig, ServeError, Server, openapi_document};

const TOKEN: &str = "a token & more";
const ENCODED: &str = "a%20token+%26%20more";

#[tokio::test]
async fn every_path_under_api_asks_for_the_token_and_no_other_does() {
    let server = start_with(|config| config.token = Some(TOKEN.to_owned())).await;
    let document = openapi_document();
    let mut asked = 0;
    for (path, item) in document["paths"].as_object().unwrap() {
        for method in item.as_object().unwrap().keys() {
            let path = path.replace("{id}", "nobody").replace("{name}", "nothing");
            let request = || server.request(&method.to_uppercase(), &path);
            if !path.starts_with("/api") {
                assert_eq!(request().send().await.status, 200, "{method} {path}");
                continue;
            }
            let refused = request().send().await;
            assert_eq!(refused.problem(), (401, "unauthorized".to_owned()), "{method} {path}");
            assert!(refused.header("www-authenticate").starts_with("Bearer"));
            assert_eq!(request().header("Authorization", "Bearer wrong").send().await.status, 401, "{method} {path}");
            let right = request().header("Authorization", &format!("Bearer {TOKEN}")).send().await;
            assert!(!matches!(right.status, 401 | 403 | 500), "{method} {path}: {}", right.text());
            asked += 1;
        }
    }
    assert!(asked >= 14, "{asked} operations");
    for path in ["/api", "/api/", "/api/v2/nothing"] {
        assert_eq!(server.get(path).await.status, 401, "{path}");
    }
    assert_eq!(server.get("/").await.status, 200);
    assert_eq!(server.get("/socket.js").await.status, 200);
    assert_eq!(server.get(&format!("/api/v1/info?token={ENCODED}")).await.status, 200);
    assert_eq!(server.get("/api/v1/info?token=wrong").await.status, 401);
    assert!(!server.get("/metrics").await.text().contains(TOKEN));
}

#[tokio::test]
async fn a_stream_asks_for_the_token_too() {
    let server = start_with(|config| config.token = Some(TOKEN.to_owned())).await;
    let opened = |path: String, header: Option<String>| async move {
        let headers: Vec<_> = header.iter().map(|value| ("Authorization", value.as_str())).collect();
        upgrade(server.address, &path, &headers).await.map(|_| ()).err()
    };
    assert_eq!(opened(path("main"), None).await, Some(401));
    assert_eq!(opened(path("main"), Some("Bearer wrong".to_owned())).await, Some(401));
    assert_eq!(opened(format!("{}?token=wrong", path("main")), None).await, Some(401));
    assert_eq!(opened(path("main"), Some(format!("Bearer {TOKEN}"))).await, None);
    assert_eq!(opened(format!("{}?token={ENCODED}", path("main")), None).await, None);
}

#[tokio::test]
async fn an_address_that_others_reach_is_not_served_without_a_token() {
    let open = ServeConfig { listen: SocketAddr::from(([0, 0, 0, 0], 0)), ..ServeConfig::default() };
    let refused = Server::bind(open.clone(), ENGINE.clone()).await;
    assert!(matches!(refused, Err(ServeError::TokenNeeded(_))));
    let empty = ServeConfig { token: Some(String::new()), ..open.clone() };
    assert!(matches!(Server::bind(empty, ENGINE.clone()).await, Err(ServeError::EmptyToken)));
    for wanted in [ServeConfig { no_auth: true, ..open.clone() }, ServeConfig { token: Some(TOKEN.to_owned()), ..open }] {
        assert!(Server::bind(wanted, ENGINE.clone()).await.is_ok());
    }
}

#[tokio::test]
async fn an_upgrade_from_a_foreign_page_is_refused() {
    let server = start_with(|config| config.origins = vec!["https://lab.example.org".to_owned()]).await;
    let own = format!("http://{}", server.address);
    let foreign =
        ["https://evil.example", "null", "http://127.0.0.1", "http://lab.example.org", "https://lab.example.org.evil.example"];
    for origin in foreign {
        assert_eq!(upgrade(server.address, &path("main"), &[("Origin", origin)]).await.err(), Some(403), "{origin}");
    }
    for origin in [own.as_str(), "https://lab.example.org"] {
        assert!(upgrade(server.address, &path("main"), &[("Origin", origin)]).await.is_ok(), "{origin}");
    }
    assert!(upgrade(server.address, &path("main"), &[]).await.is_ok(), "without an Origin it is no browser");
}

#[tokio::test]
async fn a_foreign_page_changes_nothing_and_reads_nothing() {
    let server = start().await;
    let session = server.session(&still_cloud(1)).await;
    let of = |path: &str| format!("/api/v1/sessions/{}/{path}", session.id());
    let foreign = "https://evil.example";
    let requests = [
        server.request("PATCH", &of("scene")).merge_patch(&json!({"display": {"exposure": 1}})).header("Origin", foreign),
        server.request("PUT", &of("scene")).json(&still_cloud(9)).header("Origin", "null"),
        server.request("POST", &of("control")).json(&json!({"cmd": "pause"})).header("Origin", foreign),
        server.request("POST", "/api/v1/sessions").header("Origin", foreign),
        server.request("DELETE", &of("")[..of("").len() - 1]).header("Origin", foreign),
        server
            .request("GET", &of("frame?width=16&height=16&spp=1"))
            .header("Sec-Fetch-Site", "cross-site")
            .header("Sec-Fetch-Mode", "no-cors"),
    ];
    for request in requests {
        assert_eq!(request.send().await.problem(), (403, "foreign_origin".to_owned()));
    }
    assert_eq!(session.scene().borrow().revision, 1);
    let read = server.request("GET", &of("scene")).header("Origin", foreign).send().await;
    assert_eq!(read.header("access-control-allow-origin"), "", "a browser keeps the answer from the page");
    assert_eq!(read.header("cross-origin-resource-policy"), "same-origin");
    let own = format!("http://{}", server.address);
    let patch = json!({"display": {"exposure": 1}});
    assert_eq!(server.request("PATCH", &of("scene")).merge_patch(&patch).header("Origin", &own).send().await.status, 200);
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn an_allowed_origin_may_use_the_api_from_its_page() {
    let server = start_with(|config| {
        config.origins = vec!["https://lab.example.org".to_owned()];
        config.token = Some(TOKEN.to_owned());
    })
    .await;
    let preflight = |origin: &str| {
        let request = server.request("OPTIONS", "/api/v1/sessions/main/scene");
        request.header("Origin", origin).header("Access-Control-Request-Method", "PATCH").send()
    };
    let allowed = preflight("https://lab.example.org").await;
    assert_eq!((allowed.status, allowed.header("access-control-allow-origin")), (204, "https://lab.example.org"));
    assert!(allowed.header("access-control-allow-methods").contains("PATCH"));
    let refused = preflight("https://evil.example").await;
    assert_eq!((refused.status, refused.header("access-control-allow-origin")), (401, ""));
    let read = server.request("GET", "/api/v1/info").header("Origin", "https://lab.example.org");
    assert_eq!(read.send().await.status, 401, "an allowed origin is no token");
}

#[tokio::test]
async fn a_name_that_was_rebound_to_this_machine_gets_nothing_and_a_tunnel_works() {
    let server = start().await;
    let asked = |host: &str| server.request("GET", "/api/v1/info").host(host).send();
    for host in ["evil.example", "evil.example:8080", "192.168.0.9:8080"] {
        assert_eq!(asked(host).await.problem(), (403, "foreign_host".to_owned()), "{host}");
    }
    for host in ["localhost:9999", "127.0.0.1", "[::1]:7000"] {
        assert_eq!(asked(host).await.status, 200, "{host}");
    }
}

#[tokio::test]
async fn no_path_of_this_machine_can_be_named_over_the_network() {
    let data = tempfile::tempdir().unwrap();
    let server = start_with(|config| config.data = Some(data.path().to_owned())).await;
    let session = server.session(&still_cloud(1)).await;
    let scene = format!("/api/v1/sessions/{}/scene", session.id());
    let file = |key: &str, value: &str| json!({"volumes": {"main": {"source": {"type": "file", key: value}}}});
    for name in ["/etc/passwd", "../../etc/passwd", "x.nrrd"] {
        let patched = server.request("PATCH", &scene).merge_patch(&file("path", name)).send().await;
        assert_eq!(patched.problem(), (422, "not_allowed".to_owned()), "{name}");
        assert_eq!(patched.json()["path"], "volumes.main.source.path");
        assert_eq!(server.request("PUT", &scene).json(&file("path", name)).send().await.status, 422, "{name}");
        let made = server.request("POST", "/api/v1/sessions").json(&json!({"scene": file("path", name)})).send().await;
        assert_eq!(made.problem(), (422, "not_allowed".to_owned()), "{name}");
    }
    for name in ["/etc/passwd", "../../../etc/passwd", "..", "missing.nrrd"] {
        let patched = server.request("PATCH", &scene).merge_patch(&file("dataset", name)).send().await;
        assert_eq!(patched.problem(), (422, "unknown_dataset".to_owned()), "{name}");
    }
    let mut client = Client::join(server.address, session.id()).await;
    let message = json!({"type": "patch", "patch": file("path", "/etc/passwd")}).to_string();
    assert_eq!(client.refused(&message).await, ("not_allowed".to_owned(), "volumes.main.source.path".to_owned()));
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn a_head_that_does_not_come_to_its_end_is_hung_up_on() {
    let server = start_with(|config| config.timing.header = Duration::from_millis(200)).await;
    let mut stream = TcpStream::connect(server.address).await.unwrap();
    stream.write_all(b"GET / HTTP/1.1\r\nHost: x\r\nX-Slow: ").await.unwrap();
    let mut bytes = Vec::new();
    // To the end: the server has closed.
    tokio::time::timeout(PATIENCE, stream.read_to_end(&mut bytes)).await.expect("the connection stays open").unwrap();
    assert_eq!(server.get("/healthz").await.status, 200);
}

#[tokio::test]
async fn a_body_that_does_not_come_to_its_end_is_answered_408() {
    let server = start_with(|config| config.timing.body = Duration::from_millis(200)).await;
    let mut stream = TcpStream::connect(server.address).await.unwrap();
    let head =
        "POST /api/v1/sessions HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: 10\r\n\r\n{";
    stream.write_all(head.as_bytes()).await.unwrap();
    let mut bytes = Vec::new();
    tokio::time::timeout(PATIENCE, stream.read_to_end(&mut bytes)).await.expect("the connection stays open").unwrap();
    assert_eq!(support::Response::parse(&bytes).problem(), (408, "late_body".to_owned()));
}

#[tokio::test]
async fn more_connections_than_allowed_are_answered_503_and_come_back_when_others_leave() {
    let server = start_with(|config| config.max_connections = 2).await;
    let one = Client::join(server.address, "main").await;
    let two = Client::join(server.address, "main").await;
    assert_eq!(upgrade(server.address, &path("main"), &[]).await.err(), Some(503), "sockets keep their places");
    drop((one, two));
    let free = async {
        while upgrade(server.address, &path("main"), &[]).await.is_err() {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    };
    tokio::time::timeout(PATIENCE, free).await.expect("the places are not given back");
}

#[tokio::test]
async fn who_does_not_read_is_dropped_and_slows_nobody() {
    let server = start_with(|config| config.timing.send = Duration::from_millis(300)).await;
    let session = server.session(&growing()).await;
    let mut stuck = Client::join(server.address, session.id()).await;
    let mut lively = Client::join(server.address, session.id()).await;
    // Some 60 kB that change nothing, and are told to every client; acknowledgements keep pictures coming as well.
    let nothing: serde_json::Map<_, _> = (0..900).map(|i| (format!("{i:064}"), serde_json::Value::Null)).collect();
    let long = json!({"type": "patch", "patch": {"volumes": nothing}});
    let flood = async {
        for frame in 0_u32.. {
            use futures_util::SinkExt;
            use tokio_tungstenite::tungstenite::Message;
            let ack = json!({"type": "ack", "frame": frame}).to_string();
            let sent = async {
                stuck.socket.send(Message::text(ack)).await?;
                stuck.socket.send(Message::text(long.to_string())).await
            };
            if sent.await.is_err() {
                break;
            }
        }
    };
    let watch = async {
        loop {
            lively.frame().await;
        }
    };
    let dropped = async {
        tokio::select! {
            () = flood => {}
            () = watch => {}
        }
    };
    tokio::time::timeout(PATIENCE, dropped).await.expect("the client is still served");
    let number = lively.frame().await.header.frame;
    assert!(lively.frame().await.header.frame > number);
    assert!(server.get("/metrics").await.text().contains("tyndall_slow_clients_dropped_total 1"));
    server.engine.remove(session.id()).await.unwrap();
}
