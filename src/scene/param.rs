//! How a parameter is declared: once, with its name, type, default, range and unit.
//!
//! The macros of `declare` turn a declaration into a Rust type, its JSON reader and
//! writer, its validation and its JSON Schema (2020-12). Everything else that speaks of parameters
//! (the HTTP API, the page's panel, the OpenAPI document) is derived from that schema.

use std::collections::BTreeMap;
use std::fmt;

use serde_json::{Map, Value, json};

/// Why a document was refused, and where in it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, serde::Serialize)]
#[error("{}{text}", if path.is_empty() { String::new() } else { format!("{path}: ") })]
pub struct Refusal {
    /// A stable word for programs: `unknown_key`, `wrong_type`, `out_of_range`, `not_finite`, …
    pub code: &'static str,
    /// The key's path, joined by dots: `volumes.main.medium.sigma_t`.
    pub path: String,
    /// A sentence for people.
    pub text: String,
}

/// The way from the document's root to the value being read.
#[derive(Clone, Copy)]
pub struct Place<'a> {
    parent: Option<&'a Place<'a>>,
    key: &'a str,
}

impl<'a> Place<'a> {
    /// The document itself.
    pub const ROOT: Place<'static> = Place { parent: None, key: "" };

    /// The value of `key` in the object at this place.
    #[must_use]
    pub fn key(&'a self, key: &'a str) -> Place<'a> {
        Place { parent: Some(self), key }
    }

    /// Refuses the value at this place.
    pub fn refuse(&self, code: &'static str, text: impl Into<String>) -> Refusal {
        Refusal { code, path: self.to_string(), text: text.into() }
    }
}

impl fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(parent) = self.parent else { return Ok(()) };
        if parent.parent.is_some() {
            write!(f, "{parent}.")?;
        }
        f.write_str(self.key)
    }
}

/// A value that a scene document can hold.
pub trait Param: Sized {
    /// JSON Schema of the value, without the facts that its declaration adds.
    fn schema() -> Value;
    /// Reads and checks a value.
    ///
    /// # Errors
    /// A [`Refusal`] that names the key when the value has the wrong type or is out of range.
    fn read(value: &Value, at: &Place<'_>) -> Result<Self, Refusal>;
    /// The value as JSON; reading it back gives the same value.
    fn write(&self) -> Value;
}

/// A [`Param`] that is an object with declared keys.
pub trait Fields: Param + Default {
    /// Reads the declared keys of `object`; `tag` is a key that the caller has already read.
    ///
    /// # Errors
    /// A [`Refusal`] that names the first key at fault.
    fn read_fields(object: &Map<String, Value>, tag: Option<&str>, at: &Place<'_>) -> Result<Self, Refusal>;
}

/// What a declaration says of a parameter beyond its type and default.
#[derive(Clone, Copy)]
pub struct Facts {
    /// A short label; empty: made from the key.
    pub title: &'static str,
    /// Unit of the value; empty: none.
    pub unit: &'static str,
    /// Smallest value accepted, of each component.
    pub min: f64,
    /// Largest value accepted, of each component.
    pub max: f64,
    /// Range in which a slider is useful, inside `min..=max`.
    pub slider: Option<[f64; 2]>,
    /// Whether a slider should be logarithmic.
    pub log: bool,
    /// How a value is best edited: `color`, `vector`, `angle`; empty: by its type.
    pub kind: &'static str,
    /// Tab of the page's panel; empty: that of the parent.
    pub tab: &'static str,
    /// Whether 0 is refused, in any component.
    pub nonzero: bool,
}

impl Facts {
    /// No fact at all.
    pub const NONE: Facts = Facts {
        title: "",
        unit: "",
        min: f64::NEG_INFINITY,
        max: f64::INFINITY,
        slider: None,
        log: false,
        kind: "",
        tab: "",
        nonzero: false,
    };

    /// Adds the facts to a parameter's schema.
    pub fn describe(&self, mut schema: Value, key: &str, doc: &str, default: &Value) -> Value {
        let Some(object) = schema.as_object_mut() else { return schema };
        let title = if self.title.is_empty() { title_of(key) } else { self.title.to_owned() };
        object.insert("title".into(), title.into());
        object.insert("description".into(), doc.trim().into());
        object.insert("default".into(), default.clone());
        for (name, text) in [("unit", self.unit), ("x-kind", self.kind), ("x-tab", self.tab)] {
            if !text.is_empty() {
                object.insert(name.into(), text.into());
            }
        }
        if let Some(range) = self.slider {
            object.insert("x-slider".into(), json!(range));
        }
        if self.log {
            object.insert("x-scale".into(), "log".into());
        }
        self.bound(object);
        schema
    }

    /// Writes minimum and maximum where the numbers are: here, or in an array's items.
    fn bound(&self, schema: &mut Map<String, Value>) {
        if let Some(choices) = schema.get_mut("anyOf").and_then(Value::as_array_mut) {
            for choice in choices.iter_mut().filter_map(Value::as_object_mut) {
                self.bound(choice);
            }
            return;
        }
        let numeric = matches!(schema.get("type").and_then(Value::as_str), Some("number" | "integer"));
        let target = if schema.contains_key("items") {
            let Some(items) = schema.get_mut("items").and_then(Value::as_object_mut) else { return };
            items
        } else if numeric {
            schema
        } else {
            return;
        };
        if self.min.is_finite() {
            target.insert("minimum".into(), number(self.min));
        }
        if self.max.is_finite() {
            target.insert("maximum".into(), number(self.max));
        }
        if self.nonzero {
            target.insert("not".into(), json!({"const": 0}));
        }
    }

    /// Checks the range of a number, or of each component of an array.
    ///
    /// # Errors
    /// A [`Refusal`] with the value and the bound it breaks.
    pub fn check(&self, value: &Value, at: &Place<'_>) -> Result<(), Refusal> {
        match value {
            Value::Array(items) => items.iter().try_for_each(|item| self.check(item, at)),
            Value::Number(n) => {
                let x = n.as_f64().unwrap_or(f64::NAN);
                if x < self.min {
                    return Err(at.refuse("out_of_range", format!("{n} is below the minimum {}", number(self.min))));
                }
                if x > self.max {
                    return Err(at.refuse("out_of_range", format!("{n} is above the maximum {}", number(self.max))));
                }
                if self.nonzero && x == 0.0 {
                    return Err(at.refuse("out_of_range", "0 is not allowed"));
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }
}

/// The key of a field in JSON: a trailing underscore only keeps a Rust keyword apart (`type_`).
pub const fn json_key(field: &str) -> &str {
    match field.as_bytes() {
        [name @ .., b'_'] => field.split_at(name.len()).0,
        _ => field,
    }
}

/// A JSON number without a superfluous `.0`.
fn number(x: f64) -> Value {
    #[expect(clippy::cast_possible_truncation, reason = "checked to be a small whole number")]
    if x.fract() == 0.0 && x.abs() < 9e15 { json!(x as i64) } else { json!(x) }
}

fn title_of(key: &str) -> String {
    let mut title = key.replace('_', " ");
    if let Some(first) = title.get_mut(0..1) {
        first.make_ascii_uppercase();
    }
    title
}

/// Names the JSON type of a value, for error messages.
pub fn type_name(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "a boolean",
        Value::Number(_) => "a number",
        Value::String(_) => "a string",
        Value::Array(_) => "an array",
        Value::Object(_) => "an object",
    }
}

impl Param for f32 {
    fn schema() -> Value {
        json!({"type": "number"})
    }
    #[expect(clippy::cast_possible_truncation, reason = "precision is that of the GPU; overflow is refused")]
    fn read(value: &Value, at: &Place<'_>) -> Result<Self, Refusal> {
        let Some(x) = value.as_f64() else {
            return Err(at.refuse("wrong_type", format!("expected a number, found {}", type_name(value))));
        };
        let x32 = x as f32;
        if !x32.is_finite() {
            return Err(at.refuse("not_finite", format!("{value} does not fit a 32-bit float")));
        }
        Ok(x32)
    }
    fn write(&self) -> Value {
        // The shortest decimal that reads back as this f32, not its 17-digit f64 expansion.
        let shortest = self.to_string().parse::<f64>().unwrap_or(f64::from(*self));
        if shortest.fract() == 0.0 { number(shortest) } else { json!(shortest) }
    }
}

impl Param for u32 {
    fn schema() -> Value {
        json!({"type": "integer", "minimum": 0, "maximum": u32::MAX})
    }
    fn read(value: &Value, at: &Place<'_>) -> Result<Self, Refusal> {
        // 3.0 is the integer 3 in JSON Schema.
        let whole = value.as_u64().or_else(|| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked to be whole and in range")]
            value.as_f64().filter(|x| x.fract() == 0.0 && (0.0..4.3e9).contains(x)).map(|x| x as u64)
        });
        let Some(whole) = whole else {
            return Err(at.refuse("wrong_type", format!("expected a whole number from 0, found {value}")));
        };
        u32::try_from(whole).map_err(|_| at.refuse("out_of_range", format!("{whole} is above the maximum {}", u32::MAX)))
    }
    fn write(&self) -> Value {
        json!(self)
    }
}

impl Param for bool {
    fn schema() -> Value {
        json!({"type": "boolean"})
    }
    fn read(value: &Value, at: &Place<'_>) -> Result<Self, Refusal> {
        value.as_bool().ok_or_else(|| at.refuse("wrong_type", format!("expected true or false, found {}", type_name(value))))
    }
    fn write(&self) -> Value {
        json!(self)
    }
}

impl Param for String {
    fn schema() -> Value {
        json!({"type": "string", "maxLength": 4096})
    }
    fn read(value: &Value, at: &Place<'_>) -> Result<Self, Refusal> {
        let text =
            value.as_str().ok_or_else(|| at.refuse("wrong_type", format!("expected a string, found {}", type_name(value))))?;
        if text.len() > 4096 {
            return Err(at.refuse("out_of_range", "longer than 4096 bytes"));
        }
        Ok(text.to_owned())
    }
    fn write(&self) -> Value {
        json!(self)
    }
}

impl<T: Param + Copy + Default, const N: usize> Param for [T; N] {
    fn schema() -> Value {
        json!({"type": "array", "items": T::schema(), "minItems": N, "maxItems": N})
    }
    fn read(value: &Value, at: &Place<'_>) -> Result<Self, Refusal> {
        let items = value.as_array().filter(|items| items.len() == N).ok_or_else(|| {
            let found = match value {
                Value::Array(items) => format!("an array of {}", items.len()),
                other => type_name(other).to_owned(),
            };
            at.refuse("wrong_type", format!("expected an array of {N} numbers, found {found}"))
        })?;
        let mut out = [T::default(); N];
        for (i, (slot, item)) in out.iter_mut().zip(items).enumerate() {
            *slot = T::read(item, &at.key(&i.to_string()))?;
        }
        Ok(out)
    }
    fn write(&self) -> Value {
        self.iter().map(Param::write).collect()
    }
}

impl<T: Param> Param for Option<T> {
    fn schema() -> Value {
        json!({"anyOf": [T::schema(), {"type": "null"}]})
    }
    fn read(value: &Value, at: &Place<'_>) -> Result<Self, Refusal> {
        if value.is_null() { Ok(None) } else { T::read(value, at).map(Some) }
    }
    fn write(&self) -> Value {
        self.as_ref().map_or(Value::Null, Param::write)
    }
}

/// Most entries in one collection of a document.
pub const MAX_ENTRIES: usize = 16;

impl<T: Param> Param for BTreeMap<String, T> {
    fn schema() -> Value {
        json!({"type": "object", "additionalProperties": T::schema(), "maxProperties": MAX_ENTRIES,
               "propertyNames": {"pattern": "^[A-Za-z0-9_-]{1,64}$"}})
    }
    fn read(value: &Value, at: &Place<'_>) -> Result<Self, Refusal> {
        let object = value
            .as_object()
            .ok_or_else(|| at.refuse("wrong_type", format!("expected an object, found {}", type_name(value))))?;
        if object.len() > MAX_ENTRIES {
            return Err(at.refuse("out_of_range", format!("{} entries; at most {MAX_ENTRIES} fit", object.len())));
        }
        let mut out = BTreeMap::new();
        for (name, item) in object {
            let at = at.key(name);
            if name.is_empty() || name.len() > 64 || !name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_' || b == b'-') {
                return Err(at.refuse("bad_name", "a name is 1 to 64 letters, digits, '_' or '-'"));
            }
            if !item.is_null() {
                out.insert(name.clone(), T::read(item, &at)?);
            }
        }
        Ok(out)
    }
    fn write(&self) -> Value {
        Value::Object(self.iter().map(|(name, item)| (name.clone(), item.write())).collect())
    }
}
