//! A session's stream from outside: pictures within the window, changes for everyone, slips that break nothing.
#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use futures_util::{SinkExt, StreamExt};
use serde_json::json;
use support::stream::{hello, path, upgrade};
use support::{Client, growing, start, start_with, still_cloud};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_tungstenite::tungstenite::Message;
use tyndall::stream::{Codec, FLAG_FINAL, FLAG_KEY, FLAG_LOSSLESS, HEADER_LEN, WINDOW};

#[tokio::test]
async fn a_client_is_welcomed_with_the_scene_and_gets_pictures_of_its_size() {
    let server = start().await;
    let session = server.session(&growing()).await;
    let mut client = Client::join(server.address, session.id()).await;
    let welcome = &client.welcome;
    assert_eq!((&welcome["protocol"], &welcome["session"]), (&json!("tyndall.v1"), &json!(session.id())));
    assert_eq!((&welcome["role"], &welcome["codec"]), (&json!("control"), &json!("jpeg")));
    assert_eq!(welcome["scene"], *session.scene().borrow().document);
    assert_eq!(welcome["rev"], session.scene().borrow().revision);
    let first = client.frame().await;
    let second = client.frame().await;
    assert_eq!((first.header.frame, second.header.frame), (1, 2));
    assert_eq!((first.header.codec, first.header.flags), (Codec::Jpeg, FLAG_KEY));
    let picture = image::load_from_memory(&first.payload).unwrap();
    assert_eq!([picture.width(), picture.height()], first.header.size.map(u32::from));
    assert!(second.header.begun_us >= first.header.begun_us);
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn a_converged_picture_comes_once_final_and_lossless_and_then_nothing() {
    let server = start().await;
    let session = server.session(&still_cloud(4)).await;
    let mut client = Client::join(server.address, session.id()).await;
    let last = client.frame_where(|header| header.flags & FLAG_FINAL != 0).await;
    assert_eq!((last.header.codec, last.header.flags), (Codec::Png, FLAG_KEY | FLAG_FINAL | FLAG_LOSSLESS));
    assert_eq!((last.header.spp, last.header.size), (4, [64, 48]));
    let shown = session.pictures().borrow().clone().unwrap();
    assert_eq!(image::load_from_memory(&last.payload).unwrap().to_rgba8().as_raw(), &shown.pixels);

    // Another client comes, looks and gets its own final picture; the first has seen it.
    let mut other = Client::join(server.address, session.id()).await;
    other.frame_where(|header| header.flags & FLAG_FINAL != 0).await;
    // A still has its turn after the picture that is made for who comes.
    let still = format!("/api/v1/sessions/{}/frame?width=16&height=16&spp=1", session.id());
    assert_eq!(server.get(&still).await.status, 200);
    assert_eq!(client.frames_so_far().await.len(), 0);

    client.send(&json!({"type": "patch", "patch": {"display": {"exposure": 1}}})).await;
    let next = client.frame_where(|header| header.flags & FLAG_FINAL != 0).await;
    assert!(next.header.revision > last.header.revision);
    client.send(&json!({"type": "keyframe"})).await;
    let again = client.frame().await;
    assert_eq!((again.header.flags, &again.payload), (next.header.flags, &next.payload), "asked for, it comes again");
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn a_client_without_png_gets_a_final_picture_that_is_not_lossless() {
    let server = start().await;
    let session = server.session(&still_cloud(2)).await;
    let only_jpeg = json!({"type": "hello", "codecs": ["jpeg"], "size": [64, 48]});
    let mut client = Client::join_as(server.address, session.id(), &only_jpeg).await;
    let last = client.frame_where(|header| header.flags & FLAG_FINAL != 0).await;
    assert_eq!((last.header.codec, last.header.flags), (Codec::Jpeg, FLAG_KEY | FLAG_FINAL));
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn the_newest_camera_message_comes_back_as_seq_to_its_own_client_alone() {
    let server = start().await;
    let session = server.session(&growing()).await;
    let mut client = Client::join(server.address, session.id()).await;
    let mut other = Client::join(server.address, session.id()).await;
    assert_eq!(client.frame().await.header.seq, 0);
    for seq in 1..=20 {
        client.send(&json!({"type": "camera", "seq": seq, "position": [1.5, 0.5, -2.0 - f64::from(seq) * 0.01]})).await;
    }
    let shown = client.frame_where(|header| header.seq == 20).await;
    assert!(shown.header.revision > 1);
    let told = other.text_where(|message| message["type"] == "patch" && message["patch"]["camera"]["position"][2] == -2.2).await;
    assert_eq!((&told["by"], &told["patch"]["camera"]["position"][0]), (&client.welcome["client"], &json!(1.5)));
    other.frames_so_far().await;
    assert_eq!(other.frame().await.header.seq, 0);
    // The sender's own camera is not echoed: its next patch message is the other's.
    other.send(&json!({"type": "patch", "patch": {"display": {"exposure": 0.5}}})).await;
    assert_eq!(client.text("patch").await["patch"], json!({"display": {"exposure": 0.5}}));
    assert_eq!(session.scene().borrow().document["camera"]["position"][2], -2.2);
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn a_patch_reaches_every_client_the_sender_included() {
    let server = start().await;
    let session = server.session(&growing()).await;
    let mut sender = Client::join(server.address, session.id()).await;
    let mut other = Client::join(server.address, session.id()).await;
    let patch = json!({"volumes": {"main": {"medium": {"sigma_t": 80}}}});
    sender.send(&json!({"type": "patch", "patch": patch, "gesture": "g1", "commit": true})).await;
    let (mine, theirs) = (sender.text("patch").await, other.text("patch").await);
    assert_eq!(mine, theirs);
    assert_eq!((&mine["patch"], &mine["by"]), (&patch, &sender.welcome["client"]));
    let frame = sender.frame_where(|header| u64::from(header.revision) >= mine["rev"].as_u64().unwrap()).await;
    assert!(u64::from(frame.header.revision) >= 2);
    // And so does a change over HTTP.
    let scene = format!("/api/v1/sessions/{}/scene", session.id());
    server.request("PATCH", &scene).merge_patch(&json!({"display": {"exposure": 1}})).send().await;
    assert_eq!(other.text("patch").await["by"], "api");
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn uncommitted_patches_of_one_gesture_are_one_undo_step() {
    let server = start().await;
    let session = server.session(&growing()).await;
    let mut client = Client::join(server.address, session.id()).await;
    for (value, commit) in [(1, false), (2, false), (3, true)] {
        let patch = json!({"display": {"exposure": value}});
        client.send(&json!({"type": "patch", "patch": patch, "gesture": "drag", "commit": commit})).await;
        client.text("patch").await;
    }
    client.send(&json!({"type": "control", "cmd": "undo"})).await;
    assert_eq!(client.text("patch").await["patch"]["display"]["exposure"], 0);
    client.send(&json!({"type": "control", "cmd": "redo"})).await;
    assert_eq!(client.text("patch").await["patch"]["display"]["exposure"], 3);
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn a_client_that_never_acknowledges_gets_its_window_and_holds_nobody_up() {
    let server = start().await;
    let session = server.session(&growing()).await;
    let mut silent = Client::silent(server.address, session.id()).await;
    silent.acknowledges = false;
    silent.send(&hello()).await;
    let mut lively = Client::join(server.address, session.id()).await;
    let mut frames = Vec::new();
    while frames.len() < 12 {
        frames.push(lively.frame().await.header.frame);
    }
    assert_eq!(frames, (1..=12).collect::<Vec<u32>>());
    let got: Vec<u32> = silent.frames_so_far().await.iter().map(|frame| frame.header.frame).collect();
    assert_eq!(got, (1..=u32::try_from(WINDOW).unwrap()).collect::<Vec<u32>>());
    // What was never sent cannot be acknowledged, and one acknowledgement is one frame.
    for frame in [0, 3, 99, u32::MAX] {
        silent.acknowledge(frame).await;
    }
    assert_eq!(silent.frames_so_far().await.len(), 0);
    silent.acknowledge(2).await;
    silent.acknowledge(2).await;
    assert_eq!(silent.frame().await.header.frame, 3);
    lively.frame().await;
    lively.frame().await;
    assert_eq!(silent.frames_so_far().await.len(), 0);
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn a_slip_is_answered_with_its_key_and_the_connection_stays_open() {
    let server = start().await;
    let session = server.session(&growing()).await;
    let mut client = Client::join(server.address, session.id()).await;
    let deep = format!(r#"{{"type":"patch","patch":{}1{}}}"#, r#"{"a":"#.repeat(2000), "}".repeat(2000));
    let slips = [
        ("{", "bad_json", ""),
        (r#"{"type":"patch","patch":{"display":{"exposure":NaN}}}"#, "bad_json", ""),
        (&deep, "bad_json", ""),
        ("[]", "wrong_type", ""),
        (r#"{"type":"dance"}"#, "unknown_type", "type"),
        (r#"{"type":"keyframe","soon":1}"#, "unknown_key", "soon"),
        (r#"{"type":"ack","frame":99999999999}"#, "out_of_range", "frame"),
        (r#"{"type":"camera","seq":1,"fov_y":1e39}"#, "not_finite", "camera.fov_y"),
        (r#"{"type":"camera","seq":1,"fov_y":"wide"}"#, "wrong_type", "camera.fov_y"),
        (r#"{"type":"camera","seq":1,"zoom":2}"#, "unknown_key", "camera.zoom"),
        (r#"{"type":"camera","seq":1,"position":[0,0,0],"target":[0,0,0]}"#, "out_of_range", "camera.target"),
        (r#"{"type":"patch","patch":{"volumes":{"main":{"medium":{"sigma":1}}}}}"#, "unknown_key", "volumes.main.medium.sigma"),
        (r#"{"type":"patch","patch":{"render":{"spp":0}}}"#, "out_of_range", "render.spp"),
        (r#"{"type":"resize","size":[8,8]}"#, "out_of_range", "size"),
        (r#"{"type":"control","cmd":"explode"}"#, "unknown_choice", "cmd"),
        (r#"{"type":"hello"}"#, "hello_again", ""),
    ];
    for (text, code, path) in slips {
        assert_eq!(client.refused(text).await, (code.to_owned(), path.to_owned()), "{text}");
    }
    client.socket.send(Message::binary(vec![0; 100])).await.unwrap();
    assert_eq!(client.text("error").await["code"], "not_text");
    let before = client.frame().await.header.frame;
    assert!(client.frame().await.header.frame > before, "pictures go on");
    assert_eq!(session.scene().borrow().revision, 1);
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn the_first_message_must_be_a_hello() {
    let server = start().await;
    let session = server.session(&growing()).await;
    let mut client = Client::silent(server.address, session.id()).await;
    assert_eq!(client.refused(r#"{"type":"keyframe"}"#).await.0, "hello_first");
    assert_eq!(client.refused("nonsense").await.0, "bad_json");
    assert_eq!(client.refused(r#"{"type":"hello","size":[1,1]}"#).await, ("out_of_range".to_owned(), "size".to_owned()));
    assert_eq!(client.refused(r#"{"type":"hello","codecs":["h264"]}"#).await, ("no_codec".to_owned(), "codecs".to_owned()));
    client.send(&hello()).await;
    client.text("welcome").await;
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn who_says_no_hello_is_sent_away() {
    let server = start_with(|config| config.timing.hello = std::time::Duration::from_millis(100)).await;
    let mut client = Client::silent(server.address, "main").await;
    assert_eq!(client.closed().await, 1008);
}

#[tokio::test]
async fn a_message_of_65536_bytes_is_read_and_a_longer_one_closes_with_1009() {
    let server = start().await;
    let padded = |length: usize| {
        let message = r#"{"type":"dance"}"#;
        message.to_owned() + &" ".repeat(length - message.len())
    };
    for length in [65_537, 1_000_000, 6_000_000] {
        let mut client = Client::join(server.address, "main").await;
        assert_eq!(client.refused(&padded(65_536)).await.0, "unknown_type");
        // As a browser does: reading goes on while a long message is being sent.
        let (mut sending, mut receiving) = client.socket.split();
        let close = async {
            loop {
                if let Message::Close(close) = receiving.next().await.unwrap().unwrap() {
                    return u16::from(close.unwrap().code);
                }
            }
        };
        let send = async {
            let _ = sending.send(Message::text(padded(length))).await;
            std::future::pending::<()>().await;
        };
        let closed = async {
            tokio::select! {
                code = close => code,
                () = send => 0,
            }
        };
        assert_eq!(tokio::time::timeout(support::PATIENCE, closed).await.unwrap(), 1009, "{length} bytes");
    }
    let mut silent = Client::silent(server.address, "main").await;
    silent.send_text(&padded(70_000)).await;
    assert_eq!(silent.closed().await, 1009, "before the hello as well");
}

#[tokio::test]
async fn what_is_no_websocket_message_closes_with_its_reason() {
    let server = start().await;
    for (frame, code) in [(masked("\u{fffd}", 0x83), 1002), (vec![0x81, 0x82, 0, 0, 0, 0, 0xc3, 0x28], 1007)] {
        let mut client = Client::join(server.address, "main").await;
        let tokio_tungstenite::MaybeTlsStream::Plain(stream) = client.socket.get_mut() else { panic!("no TLS here") };
        stream.write_all(&frame).await.unwrap();
        assert_eq!(client.closed().await, code);
    }
}

#[tokio::test]
async fn stats_come_with_the_streams_own_numbers() {
    let server = start().await;
    let session = server.session(&growing()).await;
    let mut client = Client::join(server.address, session.id()).await;
    client.frame().await;
    let stats = client.text("stats").await;
    for key in ["fps", "spp", "simulate_ms", "render_ms", "encode_ms", "kbps", "steps"] {
        assert!(stats[key].is_number(), "{key} in {stats}");
    }
    assert!(stats.get("noise").is_some() && stats["kbps"].as_f64().unwrap() > 0.0, "{stats}");
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn the_end_of_a_session_reaches_a_client_that_does_not_acknowledge() {
    let server = start().await;
    let session = server.session(&growing()).await;
    let mut client = Client::silent(server.address, session.id()).await;
    client.acknowledges = false;
    client.send(&hello()).await;
    while client.frame().await.header.frame < u32::try_from(WINDOW).unwrap() {}
    server.engine.remove(session.id()).await.unwrap();
    assert_eq!(client.closed().await, 1001);
}

#[tokio::test]
async fn the_end_of_a_session_and_of_the_server_are_told_apart() {
    let mut server = start().await;
    let session = server.session(&growing()).await;
    let mut of_session = Client::join(server.address, session.id()).await;
    let mut silent = Client::silent(server.address, session.id()).await;
    server.engine.remove(session.id()).await.unwrap();
    assert_eq!((of_session.closed().await, silent.closed().await), (1001, 1001));
    let mut of_main = Client::join(server.address, "main").await;
    let mut silent = Client::silent(server.address, "main").await;
    let (stopped, ..) = tokio::join!(server.stop(), async {
        assert_eq!((of_main.closed().await, silent.closed().await), (1012, 1012));
    });
    assert_eq!(stopped, ());
    assert!(TcpStream::connect(server.address).await.is_err(), "nobody listens any more");
}

#[tokio::test]
async fn a_client_that_says_goodbye_is_answered() {
    let server = start().await;
    let mut client = Client::join(server.address, "main").await;
    client.socket.close(None).await.unwrap();
    assert_eq!(client.closed().await, 1005, "the answer to a close without a code has none");
}

#[tokio::test]
async fn the_subprotocol_is_chosen_where_it_is_offered_and_not_asked_for() {
    let server = start().await;
    let offers = [("tyndall.v1", "tyndall.v1"), ("other, tyndall.v1", "tyndall.v1")];
    for (offer, chosen) in offers {
        let (_, response) = upgrade(server.address, &path("main"), &[("Sec-WebSocket-Protocol", offer)]).await.unwrap();
        assert_eq!(response.headers()["sec-websocket-protocol"], chosen);
    }
    let (_, response) = upgrade(server.address, &path("main"), &[]).await.unwrap();
    assert!(response.headers().get("sec-websocket-protocol").is_none());
    assert_eq!(upgrade(server.address, &path("nobody"), &[]).await.err(), Some(404));
}

/// A client's text as a WebSocket frame, masked with zeros.
fn masked(text: &str, opcode: u8) -> Vec<u8> {
    let length = u8::try_from(text.len()).unwrap();
    assert!(length < 126);
    let mut bytes = vec![opcode, 0x80 | length, 0, 0, 0, 0];
    bytes.extend_from_slice(text.as_bytes());
    bytes
}

#[tokio::test]
async fn messages_that_come_byte_by_byte_and_in_fragments_are_understood() {
    let server = start().await;
    let mut stream = TcpStream::connect(server.address).await.unwrap();
    stream.set_nodelay(true).unwrap();
    let head = format!(
        "GET {} HTTP/1.1\r\nHost: {}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
         Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n",
        path("main"),
        server.address
    );
    let mut bytes = head.into_bytes();
    // A text in two fragments with a ping between them, then a whole one that is refused.
    bytes.extend(masked(r#"{"type":"hel"#, 0x01));
    bytes.extend(masked("", 0x89));
    bytes.extend(masked(r#"lo","codecs":["png"]}"#, 0x80));
    bytes.extend(masked(r#"{"type":"dance"}"#, 0x81));
    let (mut reading, mut writing) = stream.split();
    let write = async {
        for byte in bytes {
            writing.write_all(&[byte]).await.unwrap();
            tokio::task::yield_now().await;
        }
    };
    let read = async {
        let mut got = Vec::new();
        let mut chunk = [0; 4096];
        while !String::from_utf8_lossy(&got).contains("unknown_type") {
            let length = reading.read(&mut chunk).await.unwrap();
            assert!(length > 0, "the server hung up after {:?}", String::from_utf8_lossy(&got));
            got.extend_from_slice(&chunk[..length]);
        }
        got
    };
    let ((), got) = tokio::time::timeout(support::PATIENCE, async { tokio::join!(write, read) }).await.unwrap();
    let got = String::from_utf8_lossy(&got).into_owned();
    assert!(got.starts_with("HTTP/1.1 101 ") && got.contains(r#""type":"welcome""#));
}

#[tokio::test]
async fn a_frame_is_a_header_of_40_bytes_and_a_payload() {
    let server = start().await;
    let session = server.session(&still_cloud(2)).await;
    let mut client = Client::join(server.address, session.id()).await;
    client.frame_where(|header| header.flags & FLAG_FINAL != 0).await;
    client.send(&json!({"type": "keyframe"})).await;
    let bytes = loop {
        if let Some(Ok(Message::Binary(bytes))) = client.socket.next().await {
            break bytes;
        }
    };
    assert_eq!(&bytes[..4], &[1, 0, 7, 0]);
    assert_eq!(&bytes[4..8], &[64, 0, 48, 0]);
    assert_eq!(&bytes[HEADER_LEN..HEADER_LEN + 4], b"\x89PNG");
    server.engine.remove(session.id()).await.unwrap();
}
