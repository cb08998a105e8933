//! Several clients of one session: who may change what, and whose size the pictures have.
#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use serde_json::{Value, json};
use support::{Client, growing, start, still_cloud};
use tyndall::stream::{FLAG_FINAL, FrameHeader};

#[tokio::test]
async fn a_viewer_sees_everything_and_changes_nothing() {
    let server = start().await;
    let session = server.session(&growing()).await;
    let mut control = Client::join(server.address, session.id()).await;
    let viewer = json!({"type": "hello", "codecs": ["jpeg"], "size": [32, 32], "role": "view"});
    let mut viewer = Client::join_as(server.address, session.id(), &viewer).await;
    assert_eq!(viewer.welcome["role"], "view");
    let tries = [
        r#"{"type":"camera","seq":1,"fov_y":20}"#,
        r#"{"type":"patch","patch":{"display":{"exposure":1}}}"#,
        r#"{"type":"control","cmd":"pause"}"#,
        r#"{"type":"control","cmd":"step"}"#,
        r#"{"type":"control","cmd":"take"}"#,
        r#"{"type":"resize","size":[48,48]}"#,
    ];
    for text in tries {
        assert_eq!(viewer.refused(text).await.0, "view_only", "{text}");
    }
    assert_eq!((session.scene().borrow().revision, session.scene().borrow().playing), (1, true));
    control.send(&json!({"type": "patch", "patch": {"display": {"exposure": 1}}})).await;
    assert_eq!(viewer.text("patch").await["patch"]["display"]["exposure"], 1);
    // The picture keeps the shape that the controlling client wants; one that was under way when it told it has another.
    viewer.frame_where(|header| header.size[0] * 48 == header.size[1] * 64).await;
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn a_holder_changes_alone_until_it_lets_go_or_leaves() {
    let server = start().await;
    let session = server.session(&growing()).await;
    let mut one = Client::join(server.address, session.id()).await;
    let mut two = Client::join(server.address, session.id()).await;
    let patch = |value: u32| json!({"type": "patch", "patch": {"display": {"exposure": value}}}).to_string();
    one.send(&json!({"type": "control", "cmd": "take"})).await;
    let told = two.text("control").await;
    assert_eq!((&told["holder"], &told["you"]), (&one.welcome["client"], &json!(false)));
    assert_eq!(one.text("control").await["you"], true);
    let camera = r#"{"type":"camera","seq":1,"fov_y":20}"#;
    for text in [&patch(1), camera, r#"{"type":"control","cmd":"pause"}"#, r#"{"type":"resize","size":[32,64]}"#] {
        assert_eq!(two.refused(text).await.0, "not_holder", "{text}");
    }
    one.send_text(&patch(2)).await;
    assert_eq!(two.text("patch").await["patch"]["display"]["exposure"], 2);
    let mut late = Client::join(server.address, session.id()).await;
    assert_eq!(late.text("control").await["holder"], one.welcome["client"]);
    // Only the holder can let go.
    two.send(&json!({"type": "control", "cmd": "release"})).await;
    assert_eq!(two.refused(&patch(3)).await.0, "not_holder");
    one.send(&json!({"type": "control", "cmd": "release"})).await;
    assert_eq!(two.text("control").await["holder"], Value::Null);
    two.send(&json!({"type": "control", "cmd": "take"})).await;
    assert_eq!(
        late.text_where(|message| message["type"] == "control" && message["holder"].is_string()).await["holder"],
        two.welcome["client"]
    );
    drop(two);
    late.text_where(|message| message["type"] == "control" && message["holder"].is_null()).await;
    late.send_text(&patch(4)).await;
    assert_eq!(late.text("patch").await["patch"]["display"]["exposure"], 4);
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn pictures_follow_the_size_that_a_client_tells() {
    let server = start().await;
    let session = server.session(&still_cloud(2)).await;
    let mut client = Client::join(server.address, session.id()).await;
    client.send(&json!({"type": "resize", "size": [40, 24]})).await;
    let frame = client.frame_where(|header| header.flags & FLAG_FINAL != 0 && header.size == [40, 24]).await;
    assert_eq!(image::load_from_memory(&frame.payload).unwrap().width(), 40);
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn pictures_have_the_last_told_size_again_when_another_client_leaves() {
    let server = start().await;
    let session = server.session(&growing()).await;
    let mut desk = Client::join(server.address, session.id()).await;
    let of_shape = |width: u16, height: u16| {
        move |header: &FrameHeader| u32::from(header.size[0]) * u32::from(height) == u32::from(header.size[1]) * u32::from(width)
    };
    let phone = json!({"type": "hello", "codecs": ["jpeg"], "size": [32, 64]});
    let phone = Client::join_as(server.address, session.id(), &phone).await;
    desk.frame_where(of_shape(32, 64)).await;
    drop(phone);
    desk.frame_where(of_shape(64, 48)).await;
    server.engine.remove(session.id()).await.unwrap();
}
