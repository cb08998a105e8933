//! What a client is told: JSON text.

use serde_json::{Value, json};

use crate::engine::{ClientId, EngineError, Event, SceneState, Stats};
use crate::gpu::GpuError;
use crate::scene::Refusal;
use crate::scene::history::Change;

/// The name of the protocol, which is the WebSocket's subprotocol as well.
pub(in crate::server) const PROTOCOL: &str = "tyndall.v1";

/// Who a client is and where the session stands. It may come again, where the client has missed changes; it then
/// replaces all that the client knew.
pub(super) struct Welcome<'a> {
    pub(super) session: &'a str,
    pub(super) client: ClientId,
    pub(super) role: &'static str,
    pub(super) codec: &'static str,
    pub(super) scene: &'a SceneState,
    pub(super) holder: Option<ClientId>,
}

impl Welcome<'_> {
    pub(super) fn text(&self) -> String {
        let message = json!({
            "type": "welcome", "protocol": PROTOCOL, "session": self.session, "client": name(self.client), "role": self.role,
            "codec": self.codec, "rev": self.scene.revision, "playing": self.scene.playing, "holder": self.holder.map(name),
            "scene": &*self.scene.document,
        });
        message.to_string()
    }
}

/// A change of the scene. Nobody alone made a camera message by 0: several clients moved at once.
fn patch(change: &Change, by: ClientId, camera: bool) -> String {
    let by = (by != 0 || !camera).then(|| name(by));
    json!({"type": "patch", "rev": change.revision, "by": by, "patch": change.patch}).to_string()
}

/// How the session and this client's stream fare.
pub(super) fn stats(stats: &Stats, encode_ms: f32, kbps: f32) -> String {
    let mut message = json!({"type": "stats"});
    if let (Some(message), Ok(Value::Object(stats))) = (message.as_object_mut(), serde_json::to_value(stats)) {
        message.extend(stats);
        message.insert("encode_ms".into(), json!(encode_ms));
        message.insert("kbps".into(), json!(kbps));
    }
    message.to_string()
}

/// Something that a person should know.
pub(super) fn notice(level: &str, code: &str, text: &str) -> String {
    json!({"type": "notice", "level": level, "code": code, "text": text}).to_string()
}

/// A message that was refused.
pub(super) fn error(refusal: &Refusal) -> String {
    json!({"type": "error", "code": refusal.code, "path": refusal.path, "text": refusal.text}).to_string()
}

/// Who holds the control.
pub(super) fn control(holder: Option<ClientId>, me: ClientId) -> String {
    json!({"type": "control", "holder": holder.map(name), "you": holder == Some(me)}).to_string()
}

/// What an event says to a client, if it is for that client. Changes up to `known` are in its welcome already, and its
/// own camera messages are not echoed.
pub(super) fn event(event: &Event, me: ClientId, known: u32) -> Option<String> {
    match event {
        Event::Patched { camera: true, by, .. } if *by == me => None,
        Event::Patched { change, by, camera } => is_later(change.revision, known).then(|| patch(change, *by, *camera)),
        Event::Notice { level, code, text } => Some(notice(level, code, text)),
        Event::Refused(client, refusal) => (*client == me).then(|| error(refusal)),
        Event::Stats(_) => None,
    }
}

/// Whether a revision comes after another; revisions wrap.
fn is_later(revision: u32, than: u32) -> bool {
    let distance = revision.wrapping_sub(than);
    distance != 0 && distance < u32::MAX / 2
}

/// The engine's refusal of a message.
pub(super) fn refusal(error: EngineError) -> Refusal {
    let text = error.to_string();
    let code = match error {
        EngineError::Refused(refusal) => return refusal,
        EngineError::Stale(_) => "stale",
        EngineError::Gpu(GpuError::TooLarge { .. }) => "too_large",
        EngineError::Gpu(_) => "gpu",
        EngineError::NotFound(_) => "not_found",
        EngineError::Limit(_) => "limit",
        EngineError::Gone => "gone",
    };
    Refusal { code, path: String::new(), text }
}

/// A client's name in messages; changes over HTTP are by `api`.
fn name(client: ClientId) -> String {
    if client == 0 { "api".to_owned() } else { client.to_string() }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    fn patched(revision: u32, by: ClientId, camera: bool) -> Event {
        Event::Patched { change: Arc::new(Change { revision, patch: json!({"a": 1}) }), by, camera }
    }

    #[test]
    fn own_patches_come_back_and_own_camera_messages_do_not() {
        let text = event(&patched(8, 3, false), 3, 7).unwrap();
        assert_eq!(text, r#"{"type":"patch","rev":8,"by":"3","patch":{"a":1}}"#);
        assert!(event(&patched(8, 3, true), 3, 7).is_none());
        assert!(event(&patched(8, 4, true), 3, 7).is_some());
        assert_eq!(event(&patched(8, 0, true), 3, 7).unwrap(), r#"{"type":"patch","rev":8,"by":null,"patch":{"a":1}}"#);
        assert_eq!(event(&patched(8, 0, false), 3, 7).unwrap(), r#"{"type":"patch","rev":8,"by":"api","patch":{"a":1}}"#);
    }

    #[test]
    fn a_change_that_the_welcome_shows_is_not_told_again() {
        assert!(event(&patched(7, 4, false), 3, 7).is_none());
        assert!(event(&patched(0, 4, false), 3, u32::MAX).is_some(), "revisions wrap");
    }

    #[test]
    fn a_refusal_is_for_its_client_alone() {
        let refused = Event::Refused(3, Refusal { code: "out_of_range", path: "camera.target".into(), text: "x".into() });
        assert_eq!(event(&refused, 3, 0).unwrap(), r#"{"type":"error","code":"out_of_range","path":"camera.target","text":"x"}"#);
        assert!(event(&refused, 4, 0).is_none());
    }

    #[test]
    fn stats_have_the_clients_own_numbers_beside_the_sessions() {
        let text = stats(&Stats { spp: 16, noise: None, ..Stats::default() }, 4.5, 800.0);
        let message: Value = serde_json::from_str(&text).unwrap();
        for key in ["fps", "spp", "noise", "simulate_ms", "render_ms", "encode_ms", "kbps", "steps"] {
            assert!(message.get(key).is_some(), "{key} in {text}");
        }
        assert_eq!((&message["type"], &message["spp"], &message["encode_ms"]), (&json!("stats"), &json!(16), &json!(4.5)));
    }
}
