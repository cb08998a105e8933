//! Objects that are no part of a scene: read key by key, with the same refusals as a scene's.

use serde_json::{Map, Value};

use crate::scene::Refusal;
use crate::scene::param::{Param, Place, type_name};

/// An object of which each key is taken once.
pub(super) struct Fields<'a>(&'a Map<String, Value>);

impl<'a> Fields<'a> {
    /// The object, if it has none but these keys.
    pub(super) fn of(value: &'a Value, known: &[&str]) -> Result<Self, Refusal> {
        let object = object(value, &Place::ROOT)?;
        match object.keys().find(|key| !known.contains(&key.as_str())) {
            Some(key) => {
                let text = format!("unknown key; here stand: {}", known.join(", "));
                Err(Place::ROOT.key(key).refuse("unknown_key", text))
            }
            None => Ok(Self(object)),
        }
    }

    /// The value of a key; null is the same as none.
    pub(super) fn raw(&self, key: &str) -> Option<&'a Value> {
        self.0.get(key).filter(|value| !value.is_null())
    }

    /// The value of a key, read and checked.
    pub(super) fn get<T: Param>(&self, key: &str) -> Result<Option<T>, Refusal> {
        self.raw(key).map(|value| T::read(value, &Place::ROOT.key(key))).transpose()
    }

    /// The value of a key that must be there.
    pub(super) fn need<T: Param>(&self, key: &str) -> Result<T, Refusal> {
        self.get(key)?.ok_or_else(|| missing(key))
    }
}

/// The refusal of an object without this key.
pub(super) fn missing(key: &str) -> Refusal {
    Place::ROOT.key(key).refuse("missing_key", format!("the key `{key}` is missing"))
}

/// The value as an object.
pub(super) fn object<'a>(value: &'a Value, at: &Place<'_>) -> Result<&'a Map<String, Value>, Refusal> {
    value.as_object().ok_or_else(|| at.refuse("wrong_type", format!("expected an object, found {}", type_name(value))))
}

/// Refuses a number outside `low..=high`.
pub(super) fn within(key: &str, value: u32, low: u32, high: u32) -> Result<u32, Refusal> {
    if (low..=high).contains(&value) {
        return Ok(value);
    }
    Err(Place::ROOT.key(key).refuse("out_of_range", format!("{value} is not within {low} to {high}")))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn unknown_missing_and_wrong_keys_are_refused_by_name() {
        let code_and_path = |refusal: Refusal| (refusal.code, refusal.path);
        let value = json!({"cmd": "step", "steps": -1, "none": null});
        assert_eq!(code_and_path(Fields::of(&value, &["cmd"]).err().unwrap()), ("unknown_key", "steps".to_owned()));
        let fields = Fields::of(&value, &["cmd", "steps", "none"]).unwrap();
        assert_eq!(fields.need::<String>("cmd").unwrap(), "step");
        assert_eq!(fields.get::<u32>("none").unwrap(), None);
        assert_eq!(code_and_path(fields.get::<u32>("steps").unwrap_err()), ("wrong_type", "steps".to_owned()));
        assert_eq!(code_and_path(fields.need::<u32>("none").unwrap_err()), ("missing_key", "none".to_owned()));
        assert_eq!(Fields::of(&json!([1]), &[]).err().unwrap().code, "wrong_type");
    }
}
