//! What a client says: JSON text, read strictly, so that a slip is answered and never guessed at.

use serde_json::{Map, Value};

use crate::engine::Control;
use crate::scene::Refusal;
use crate::scene::param::{Param, Place, type_name};
use crate::server::fields::{Fields, missing, object, within};
use crate::server::rooms::Role;
use crate::server::{sessions, still};
use crate::stream::Codec;

/// A message of a client.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Message {
    Hello(Hello),
    Camera { seq: u32, keys: Map<String, Value> },
    Patch { patch: Value, gesture: Option<String>, commit: bool },
    Ack { frame: u32 },
    Keyframe,
    Resize([u32; 2]),
    Control(Control),
    Take,
    Release,
}

/// The first message.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Hello {
    /// The codec for moving pictures: the first that the client names and the server writes.
    pub(super) codec: Codec,
    /// Whether the final picture may be a PNG.
    pub(super) png: bool,
    pub(super) size: Option<[u32; 2]>,
    pub(super) role: Role,
}

impl Message {
    /// Reads a message.
    ///
    /// # Errors
    /// A [`Refusal`] that names the key at fault, `code` `bad_json` where it is no JSON.
    pub(super) fn parse(text: &str) -> Result<Self, Refusal> {
        let value: Value = serde_json::from_str(text)
            .map_err(|error| Place::ROOT.refuse("bad_json", format!("the message is not JSON: {error}")))?;
        let keys = object(&value, &Place::ROOT)?;
        let kind = keys.get("type").ok_or_else(|| missing("type"))?;
        match kind.as_str() {
            Some("hello") => hello(&value).map(Self::Hello),
            Some("camera") => camera(keys),
            Some("patch") => patch(&value),
            Some("ack") => {
                let fields = Fields::of(&value, &["type", "frame", "decode_ms"])?;
                fields.get::<f32>("decode_ms")?;
                Ok(Self::Ack { frame: fields.need("frame")? })
            }
            Some("keyframe") => Fields::of(&value, &["type"]).map(|_| Self::Keyframe),
            Some("resize") => {
                let fields = Fields::of(&value, &["type", "size"])?;
                Ok(Self::Resize(size(&fields)?.ok_or_else(|| missing("size"))?))
            }
            Some("control") => control(&value),
            _ => {
                let known = "hello, camera, patch, ack, keyframe, resize, control";
                Err(Place::ROOT.key("type").refuse("unknown_type", format!("{kind} is not one of: {known}")))
            }
        }
    }
}

fn hello(value: &Value) -> Result<Hello, Refusal> {
    let fields = Fields::of(value, &["type", "codecs", "size", "role"])?;
    let place = Place::ROOT.key("codecs");
    let names: Vec<&str> = match fields.raw("codecs") {
        None => vec!["jpeg", "png"],
        Some(Value::Array(names)) => names
            .iter()
            .map(|name| name.as_str().ok_or_else(|| place.refuse("wrong_type", "expected an array of names")))
            .collect::<Result<_, _>>()?,
        Some(other) => {
            return Err(place.refuse("wrong_type", format!("expected an array of names, found {}", type_name(other))));
        }
    };
    // Names that this server does not know are those of a newer client.
    let codec = names.iter().find_map(|name| Codec::named(name));
    let role = match fields.get::<String>("role")?.as_deref() {
        None | Some("control") => Role::Control,
        Some("view") => Role::View,
        Some(other) => {
            let text = format!("{other:?} is not one of: control, view");
            return Err(Place::ROOT.key("role").refuse("unknown_choice", text));
        }
    };
    let size = size(&fields)?;
    let codec = codec.ok_or_else(|| place.refuse("no_codec", "none of these codecs is served; there are jpeg and png"))?;
    Ok(Hello { codec, png: names.contains(&"png"), size, role })
}

fn size(fields: &Fields<'_>) -> Result<Option<[u32; 2]>, Refusal> {
    let Some(size) = fields.get::<[u32; 2]>("size")? else { return Ok(None) };
    for edge in size {
        within("size", edge, still::MIN_EDGE, still::MAX_EDGE)?;
    }
    Ok(Some(size))
}

fn camera(keys: &Map<String, Value>) -> Result<Message, Refusal> {
    let seq = keys.get("seq").map_or(Ok(0), |seq| u32::read(seq, &Place::ROOT.key("seq")))?;
    let keys = keys.iter().filter(|(key, _)| !matches!(key.as_str(), "type" | "seq"));
    Ok(Message::Camera { seq, keys: keys.map(|(key, value)| (key.clone(), value.clone())).collect() })
}

fn patch(value: &Value) -> Result<Message, Refusal> {
    let fields = Fields::of(value, &["type", "patch", "gesture", "commit"])?;
    let patch = fields.raw("patch").ok_or_else(|| missing("patch"))?;
    object(patch, &Place::ROOT.key("patch"))?;
    Ok(Message::Patch { patch: patch.clone(), gesture: fields.get("gesture")?, commit: fields.get("commit")?.unwrap_or(true) })
}

fn control(value: &Value) -> Result<Message, Refusal> {
    let fields = Fields::of(value, &["type", "cmd", "steps"])?;
    Ok(match sessions::command(&fields)? {
        Some(command) => Message::Control(command),
        None if fields.raw("cmd").is_some_and(|word| word == "take") => Message::Take,
        None => Message::Release,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_message_is_read() {
        let camera = Message::parse(r#"{"type":"camera","seq":812,"position":[1,2,3],"fov_y":40}"#).unwrap();
        let Message::Camera { seq: 812, keys } = camera else { panic!("{camera:?}") };
        assert_eq!(Value::Object(keys), serde_json::json!({"position": [1, 2, 3], "fov_y": 40}));
        let cases = [
            (r#"{"type":"ack","frame":9001,"decode_ms":3.1}"#, Message::Ack { frame: 9001 }),
            (r#"{"type":"ack","frame":1}"#, Message::Ack { frame: 1 }),
            (r#"{"type":"keyframe"}"#, Message::Keyframe),
            (r#"{"type":"resize","size":[16,8192]}"#, Message::Resize([16, 8192])),
            (r#"{"type":"control","cmd":"step"}"#, Message::Control(Control::Step(1))),
            (r#"{"type":"control","cmd":"step","steps":30}"#, Message::Control(Control::Step(30))),
            (r#"{"type":"control","cmd":"take"}"#, Message::Take),
            (r#"{"type":"control","cmd":"release"}"#, Message::Release),
            (
                r#"{"type":"patch","patch":{},"gesture":null}"#,
                Message::Patch { patch: Value::Object(Map::new()), gesture: None, commit: true },
            ),
            (
                r#"{"type":"hello","codecs":["h264","png","jpeg"],"size":[1280,720],"role":"view"}"#,
                Message::Hello(Hello { codec: Codec::Png, png: true, size: Some([1280, 720]), role: Role::View }),
            ),
            (
                r#"{"type":"hello","codecs":["h264","jpeg"]}"#,
                Message::Hello(Hello { codec: Codec::Jpeg, png: false, size: None, role: Role::Control }),
            ),
        ];
        for (text, message) in cases {
            assert_eq!(Message::parse(text).as_ref(), Ok(&message), "{text}");
        }
    }

    #[test]
    fn each_slip_is_refused_with_its_key() {
        let cases = [
            ("", "bad_json", ""),
            ("{", "bad_json", ""),
            (r#"{"type":"camera","fov_y":NaN}"#, "bad_json", ""),
            (r#"{"type":"camera","fov_y":1e999}"#, "bad_json", ""),
            ("[]", "wrong_type", ""),
            ("null", "wrong_type", ""),
            ("{}", "missing_key", "type"),
            (r#"{"type":3}"#, "unknown_type", "type"),
            (r#"{"type":"nonsense"}"#, "unknown_type", "type"),
            (r#"{"type":"ack"}"#, "missing_key", "frame"),
            (r#"{"type":"ack","frame":-1}"#, "wrong_type", "frame"),
            (r#"{"type":"ack","frame":4294967296}"#, "out_of_range", "frame"),
            (r#"{"type":"ack","frame":1,"decode_ms":1e39}"#, "not_finite", "decode_ms"),
            (r#"{"type":"camera","seq":99999999999}"#, "out_of_range", "seq"),
            (r#"{"type":"keyframe","now":true}"#, "unknown_key", "now"),
            (r#"{"type":"resize"}"#, "missing_key", "size"),
            (r#"{"type":"resize","size":[15,100]}"#, "out_of_range", "size"),
            (r#"{"type":"resize","size":[100,8193]}"#, "out_of_range", "size"),
            (r#"{"type":"resize","size":[100]}"#, "wrong_type", "size"),
            (r#"{"type":"patch"}"#, "missing_key", "patch"),
            (r#"{"type":"patch","patch":[1]}"#, "wrong_type", "patch"),
            (r#"{"type":"patch","patch":{},"commit":1}"#, "wrong_type", "commit"),
            (r#"{"type":"control","cmd":"fly"}"#, "unknown_choice", "cmd"),
            (r#"{"type":"control","cmd":"step","steps":0}"#, "out_of_range", "steps"),
            (r#"{"type":"hello","codecs":["h264"]}"#, "no_codec", "codecs"),
            (r#"{"type":"hello","codecs":"jpeg"}"#, "wrong_type", "codecs"),
            (r#"{"type":"hello","role":"owner"}"#, "unknown_choice", "role"),
        ];
        for (text, code, path) in cases {
            let refusal = Message::parse(text).unwrap_err();
            assert_eq!((refusal.code, refusal.path.as_str()), (code, path), "{text}");
        }
        let deep = format!(r#"{{"type":"patch","patch":{}1{}}}"#, r#"{"a":"#.repeat(5000), "}".repeat(5000));
        assert_eq!(Message::parse(&deep).unwrap_err().code, "bad_json");
    }
}
