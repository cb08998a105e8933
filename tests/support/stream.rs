//! A client of a stream, as a browser is one.

use std::collections::VecDeque;
use std::net::SocketAddr;

use futures_util::{SinkExt, StreamExt};
use serde_json::{Value, json};
use tokio::net::TcpStream;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::{self, Message};
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};
use tyndall::stream::FrameHeader;

use super::PATIENCE;

pub struct Client {
    pub socket: WebSocketStream<MaybeTlsStream<TcpStream>>,
    /// What the server said at first.
    pub welcome: Value,
    /// Messages that came while something else was waited for.
    texts: VecDeque<Value>,
    frames: VecDeque<Frame>,
    /// Whether each frame is acknowledged as it comes.
    pub acknowledges: bool,
}

/// A picture as it came.
#[derive(Debug, Clone)]
pub struct Frame {
    pub header: FrameHeader,
    pub payload: Vec<u8>,
}

/// The answer to an upgrade with these headers: the socket, or the status of the refusal.
pub async fn upgrade(
    address: SocketAddr,
    path: &str,
    headers: &[(&'static str, &str)],
) -> Result<(WebSocketStream<MaybeTlsStream<TcpStream>>, tungstenite::handshake::client::Response), u16> {
    let mut request = format!("ws://{address}{path}").into_client_request().unwrap();
    for (name, value) in headers {
        request.headers_mut().append(*name, value.parse().unwrap());
    }
    match tokio::time::timeout(PATIENCE, connect_async(request)).await.expect("the server did not answer") {
        Ok(opened) => Ok(opened),
        Err(tungstenite::Error::Http(response)) => Err(response.status().as_u16()),
        Err(error) => panic!("{error}"),
    }
}

pub fn path(session: &str) -> String {
    format!("/api/v1/sessions/{session}/ws")
}

pub fn hello() -> Value {
    json!({"type": "hello", "codecs": ["h264", "jpeg", "png"], "size": [64, 48], "role": "control"})
}

impl Client {
    /// A client that is connected and has said nothing yet.
    pub async fn silent(address: SocketAddr, session: &str) -> Self {
        let (socket, _) = upgrade(address, &path(session), &[("Sec-WebSocket-Protocol", "tyndall.v1")]).await.unwrap();
        Self { socket, welcome: Value::Null, texts: VecDeque::new(), frames: VecDeque::new(), acknowledges: true }
    }

    /// A client that has been welcomed.
    pub async fn join(address: SocketAddr, session: &str) -> Self {
        Self::join_as(address, session, &hello()).await
    }

    /// A client with a `hello` of its own.
    pub async fn join_as(address: SocketAddr, session: &str, hello: &Value) -> Self {
        let mut client = Self::silent(address, session).await;
        client.send(hello).await;
        client.welcome = client.text("welcome").await;
        client
    }

    pub async fn send(&mut self, message: &Value) {
        self.send_text(&message.to_string()).await;
    }

    pub async fn send_text(&mut self, text: &str) {
        self.socket.send(Message::text(text)).await.unwrap();
    }

    pub async fn acknowledge(&mut self, frame: u32) {
        self.send(&json!({"type": "ack", "frame": frame, "decode_ms": 1.5})).await;
    }

    /// Takes one message off the socket; false when it is closed.
    async fn pump(&mut self) -> bool {
        match self.socket.next().await {
            Some(Ok(Message::Text(text))) => self.texts.push_back(serde_json::from_str(&text).unwrap()),
            Some(Ok(Message::Binary(bytes))) => {
                let (header, payload) = FrameHeader::split(&bytes).expect("a frame");
                if self.acknowledges {
                    self.acknowledge(header.frame).await;
                }
                self.frames.push_back(Frame { header, payload: payload.to_vec() });
            }
            Some(Ok(Message::Ping(_) | Message::Pong(_))) => {}
            _ => return false,
        }
        true
    }

    /// The next message of this type; those of other types are thrown away.
    pub async fn text(&mut self, kind: &str) -> Value {
        self.text_where(|message| message["type"] == kind).await
    }

    /// The next message that fits; those before it are thrown away.
    pub async fn text_where(&mut self, fits: impl Fn(&Value) -> bool) -> Value {
        let wait = async {
            loop {
                while let Some(message) = self.texts.pop_front() {
                    if fits(&message) {
                        return message;
                    }
                }
                assert!(self.pump().await, "the socket was closed");
            }
        };
        tokio::time::timeout(PATIENCE, wait).await.expect("no such message came")
    }

    /// The next frame.
    pub async fn frame(&mut self) -> Frame {
        self.frame_where(|_| true).await
    }

    /// The next frame that fits; those before it are thrown away.
    pub async fn frame_where(&mut self, fits: impl Fn(&FrameHeader) -> bool) -> Frame {
        let wait = async {
            loop {
                while let Some(frame) = self.frames.pop_front() {
                    if fits(&frame.header) {
                        return frame;
                    }
                }
                assert!(self.pump().await, "the socket was closed");
            }
        };
        tokio::time::timeout(PATIENCE, wait).await.expect("no such frame came")
    }

    /// Sends something and waits for its refusal: code and path.
    pub async fn refused(&mut self, text: &str) -> (String, String) {
        self.send_text(text).await;
        let error = self.text("error").await;
        assert!(!error["text"].as_str().unwrap().is_empty());
        (error["code"].as_str().unwrap().to_owned(), error["path"].as_str().unwrap().to_owned())
    }

    /// Frames that came up to now: all that came before the answer to a message sent now.
    pub async fn frames_so_far(&mut self) -> Vec<Frame> {
        self.refused(r#"{"type":"so far"}"#).await;
        self.frames.drain(..).collect()
    }

    /// Reads to the end; the code of the close.
    pub async fn closed(&mut self) -> u16 {
        let wait = async {
            loop {
                match self.socket.next().await {
                    Some(Ok(Message::Close(close))) => return close.map_or(1005, |close| close.code.into()),
                    Some(Ok(_)) => {}
                    other => panic!("the connection ended without a close: {other:?}"),
                }
            }
        };
        tokio::time::timeout(PATIENCE, wait).await.expect("the connection stays open")
    }
}
