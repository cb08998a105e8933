//! The declarations themselves: `params!` an object, `choice!` one of a few words, `tagged!` an object whose `type`
//! decides which keys it has. Each makes the Rust type and its `Param`.

/// Declares an object of parameters: `key: Type = default => { facts },`.
macro_rules! params {
    ($(#[doc = $doc:literal])* pub struct $name:ident {
        $($(#[doc = $fdoc:literal])* $field:ident : $ty:ty = $default:expr => { $($fact:ident : $value:expr),* $(,)? }),* $(,)?
    }) => {
        $(#[doc = $doc])*
        #[derive(Debug, Clone, PartialEq)]
        pub struct $name { $($(#[doc = $fdoc])* pub $field: $ty),* }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default),* }
            }
        }

        impl $crate::scene::param::Param for $name {
            fn schema() -> serde_json::Value {
                #[allow(unused_imports, reason = "a declaration without fields needs none of them")]
                use $crate::scene::param::{Facts, Param};
                #[allow(unused_mut, reason = "likewise")]
                let mut properties = serde_json::Map::new();
                $({
                    let default: $ty = $default;
                    let facts = Facts { $($fact: $value,)* ..Facts::NONE };
                    let schema = facts.describe(<$ty>::schema(), $crate::scene::param::json_key(stringify!($field)), concat!($($fdoc),*), &default.write());
                    properties.insert($crate::scene::param::json_key(stringify!($field)).to_owned(), schema);
                })*
                serde_json::json!({"type": "object", "properties": properties, "additionalProperties": false,
                    "description": concat!($($doc),*).trim()})
            }
            fn read(value: &serde_json::Value, at: &$crate::scene::param::Place<'_>) -> Result<Self, $crate::scene::param::Refusal> {
                let object = value.as_object().ok_or_else(|| at.refuse(
                    "wrong_type", format!("expected an object, found {}", $crate::scene::param::type_name(value))))?;
                $crate::scene::param::Fields::read_fields(object, None, at)
            }
            fn write(&self) -> serde_json::Value {
                #[allow(unused_mut, reason = "a declaration without fields writes nothing")]
                let mut object = serde_json::Map::new();
                $(object.insert($crate::scene::param::json_key(stringify!($field)).to_owned(), self.$field.write());)*
                serde_json::Value::Object(object)
            }
        }

        impl $crate::scene::param::Fields for $name {
            fn read_fields(
                object: &serde_json::Map<String, serde_json::Value>,
                tag: Option<&str>,
                at: &$crate::scene::param::Place<'_>,
            ) -> Result<Self, $crate::scene::param::Refusal> {
                const KEYS: &[&str] = &[$($crate::scene::param::json_key(stringify!($field))),*];
                for key in object.keys() {
                    if tag != Some(key.as_str()) && !KEYS.contains(&key.as_str()) {
                        let known = tag.iter().chain(KEYS).copied().collect::<Vec<_>>().join(", ");
                        return Err(at.key(key).refuse("unknown_key", format!("unknown key; here stand: {known}")));
                    }
                }
                #[allow(unused_mut, reason = "a declaration without fields reads nothing")]
                let mut out = Self::default();
                $(if let Some(value) = object.get($crate::scene::param::json_key(stringify!($field))).filter(|value| !value.is_null()) {
                    #[allow(unused_imports, reason = "the first field's import serves all")]
                    use $crate::scene::param::{Facts, Param};
                    let at = at.key($crate::scene::param::json_key(stringify!($field)));
                    out.$field = <$ty>::read(value, &at)?;
                    Facts { $($fact: $value,)* ..Facts::NONE }.check(value, &at)?;
                })*
                Ok(out)
            }
        }
    };
}

/// Declares a parameter that is one of a few words: `Variant = "word",`; the first is the default.
macro_rules! choice {
    ($(#[doc = $doc:literal])* pub enum $name:ident {
        $(#[doc = $fdoc:literal])* $first:ident = $fword:literal
        $(, $(#[doc = $vdoc:literal])* $variant:ident = $word:literal)* $(,)?
    }) => {
        $(#[doc = $doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
        pub enum $name { $(#[doc = $fdoc])* #[default] $first, $($(#[doc = $vdoc])* $variant),* }

        impl $name {
            /// The word that stands for this choice in a document.
            pub fn word(self) -> &'static str {
                match self { Self::$first => $fword, $(Self::$variant => $word),* }
            }
        }

        impl $crate::scene::param::Param for $name {
            fn schema() -> serde_json::Value {
                serde_json::json!({"type": "string", "enum": [$fword $(, $word)*]})
            }
            fn read(value: &serde_json::Value, at: &$crate::scene::param::Place<'_>) -> Result<Self, $crate::scene::param::Refusal> {
                match value.as_str() {
                    Some($fword) => Ok(Self::$first),
                    $(Some($word) => Ok(Self::$variant),)*
                    _ => Err(at.refuse("unknown_choice", format!("{value} is not one of: {}", [$fword $(, $word)*].join(", ")))),
                }
            }
            fn write(&self) -> serde_json::Value {
                self.word().into()
            }
        }
    };
}

/// Declares an object whose key `type` decides which other keys it has; the first is the default.
macro_rules! tagged {
    ($(#[doc = $doc:literal])* pub enum $name:ident {
        $(#[doc = $fdoc:literal])* $first:ident($fty:ty) = $fword:literal
        $(, $(#[doc = $vdoc:literal])* $variant:ident($ty:ty) = $word:literal)* $(,)?
    }) => {
        $(#[doc = $doc])*
        #[derive(Debug, Clone, PartialEq)]
        pub enum $name { $(#[doc = $fdoc])* $first($fty), $($(#[doc = $vdoc])* $variant($ty)),* }

        impl $name {
            /// The word under the key `type`.
            pub fn word(&self) -> &'static str {
                match self { Self::$first(_) => $fword, $(Self::$variant(_) => $word),* }
            }
        }

        impl Default for $name {
            fn default() -> Self {
                Self::$first(<$fty>::default())
            }
        }

        $crate::scene::declare::tagged!(@param $name {
            $(#[doc = $fdoc])* $first($fty) = $fword
            $(, $(#[doc = $vdoc])* $variant($ty) = $word)*
        }, concat!($($doc),*));
    };
    (@param $name:ident {
        $($(#[doc = $vdoc:literal])* $variant:ident($ty:ty) = $word:literal),*
    }, $doc:expr) => {

        impl $crate::scene::param::Param for $name {
            fn schema() -> serde_json::Value {
                let variants: Vec<serde_json::Value> = vec![$({
                    let mut schema = <$ty as $crate::scene::param::Param>::schema();
                    let mut properties = serde_json::Map::new();
                    properties.insert("type".to_owned(), serde_json::json!({"const": $word}));
                    if let Some(own) = schema["properties"].as_object() {
                        properties.extend(own.clone());
                    }
                    schema["title"] = $word.into();
                    schema["description"] = concat!($($vdoc),*).trim().into();
                    schema["required"] = serde_json::json!(["type"]);
                    schema["properties"] = properties.into();
                    schema
                }),*];
                serde_json::json!({"oneOf": variants, "description": $doc.trim()})
            }
            fn read(value: &serde_json::Value, at: &$crate::scene::param::Place<'_>) -> Result<Self, $crate::scene::param::Refusal> {
                use $crate::scene::param::Fields;
                let object = value.as_object().ok_or_else(|| at.refuse(
                    "wrong_type", format!("expected an object, found {}", $crate::scene::param::type_name(value))))?;
                let words = [$($word),*];
                let tag = object.get("type").filter(|tag| !tag.is_null()).cloned().unwrap_or_else(|| words[0].into());
                match tag.as_str() {
                    $(Some($word) => Ok(Self::$variant(<$ty>::read_fields(object, Some("type"), at)?)),)*
                    _ => Err(at.key("type").refuse("unknown_choice", format!("{tag} is not one of: {}", words.join(", ")))),
                }
            }
            fn write(&self) -> serde_json::Value {
                let (word, fields) = match self { $(Self::$variant(fields) => ($word, $crate::scene::param::Param::write(fields))),* };
                let mut object = serde_json::Map::new();
                object.insert("type".to_owned(), word.into());
                if let serde_json::Value::Object(fields) = fields {
                    object.extend(fields);
                }
                serde_json::Value::Object(object)
            }
        }
    };
}

pub(crate) use {choice, params, tagged};
