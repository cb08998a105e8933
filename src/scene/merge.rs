//! RFC 7396 merge patches, with one addition: a patch that changes an object's `type` starts it anew.

use serde_json::{Map, Value};

/// Applies `patch` to `target` (RFC 7396). Where the patch gives an object another `type`, the old
/// type's keys that the patch does not itself name are dropped.
pub fn merge_patch(target: &mut Value, patch: &Value) {
    let Value::Object(patch) = patch else {
        *target = patch.clone();
        return;
    };
    if !target.is_object() || changes_type(target, patch) {
        *target = Value::Object(Map::new());
    }
    let Value::Object(target) = target else { return };
    for (key, value) in patch {
        if value.is_null() {
            target.shift_remove(key);
        } else {
            merge_patch(target.entry(key.clone()).or_insert(Value::Null), value);
        }
    }
}

fn changes_type(target: &Value, patch: &Map<String, Value>) -> bool {
    patch.get("type").is_some_and(|new| target.get("type").is_some_and(|old| old != new))
}

/// The patch that turns `from` into `to`, or `None` where they are equal.
pub fn diff(from: &Value, to: &Value) -> Option<Value> {
    if from == to {
        return None;
    }
    let (Value::Object(old), Value::Object(new)) = (from, to) else { return Some(to.clone()) };
    if changes_type(from, new) {
        return Some(to.clone());
    }
    let mut patch = Map::new();
    for (key, value) in new {
        match old.get(key) {
            Some(before) => patch.extend(diff(before, value).map(|change| (key.clone(), change))),
            None => {
                patch.insert(key.clone(), value.clone());
            }
        }
    }
    for key in old.keys().filter(|key| !new.contains_key(*key)) {
        patch.insert(key.clone(), Value::Null);
    }
    Some(patch.into())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn merged(mut target: Value, patch: &Value) -> Value {
        merge_patch(&mut target, patch);
        target
    }

    #[test]
    fn the_examples_of_rfc_7396_hold() {
        let cases = [
            (json!({"a":"b"}), json!({"a":"c"}), json!({"a":"c"})),
            (json!({"a":"b"}), json!({"b":"c"}), json!({"a":"b","b":"c"})),
            (json!({"a":"b"}), json!({"a":null}), json!({})),
            (json!({"a":"b","b":"c"}), json!({"a":null}), json!({"b":"c"})),
            (json!({"a":["b"]}), json!({"a":"c"}), json!({"a":"c"})),
            (json!({"a":"c"}), json!({"a":["b"]}), json!({"a":["b"]})),
            (json!({"a":{"b":"c"}}), json!({"a":{"b":"d","c":null}}), json!({"a":{"b":"d"}})),
            (json!({"a":[{"b":"c"}]}), json!({"a":[1]}), json!({"a":[1]})),
            (json!(["a", "b"]), json!(["c", "d"]), json!(["c", "d"])),
            (json!({"a":"b"}), json!(["c"]), json!(["c"])),
            (json!({"a":"foo"}), json!(null), json!(null)),
            (json!({"a":"foo"}), json!("bar"), json!("bar")),
            (json!({"e":null}), json!({"a":1}), json!({"e":null,"a":1})),
            (json!([1, 2]), json!({"a":"b","c":null}), json!({"a":"b"})),
            (json!({}), json!({"a":{"bb":{"ccc":null}}}), json!({"a":{"bb":{}}})),
        ];
        for (target, patch, expected) in cases {
            assert_eq!(merged(target.clone(), &patch), expected, "{target} + {patch}");
        }
    }

    #[test]
    fn another_type_drops_the_old_types_keys() {
        let old = json!({"phase": {"type": "hg", "g": 0.5}, "sigma_t": 3});
        let new = merged(old, &json!({"phase": {"type": "drift", "weight": 0.2}}));
        assert_eq!(new, json!({"phase": {"type": "drift", "weight": 0.2}, "sigma_t": 3}));
    }

    #[test]
    fn a_diff_applied_gives_the_other_document() {
        let a = json!({"x": {"type": "hg", "g": 0.5}, "list": [1, 2], "gone": {"k": 1}, "same": 1});
        let b = json!({"x": {"type": "drift"}, "list": [1, 3], "same": 1, "new": {"k": 2}});
        assert_eq!(merged(a.clone(), &diff(&a, &b).unwrap_or_default()), b);
        assert_eq!(merged(b.clone(), &diff(&b, &a).unwrap_or_default()), a);
        assert_eq!(diff(&a, &a), None);
    }
}
