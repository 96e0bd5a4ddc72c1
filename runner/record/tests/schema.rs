//! Holds the generated JSON Schema against records: a sound one passes, a damaged one does not.

use record::{Method, Record, example, json_schema};
use serde_json::{Value, json};

/// Checks a value against the parts of JSON Schema that schemars writes for our types, and returns
/// the places that do not fit. A keyword that it does not know is a place too, so that nothing
/// passes unchecked.
fn check(schema: &Value, value: &Value, root: &Value, at: &str, misfits: &mut Vec<String>) {
    let Some(schema) = schema.as_object() else {
        if schema != &json!(true) {
            misfits.push(at.into());
        }
        return;
    };
    let fits = |schema: &Value| {
        let mut inner = Vec::new();
        check(schema, value, root, at, &mut inner);
        inner.is_empty()
    };
    for (keyword, rule) in schema {
        let ok = match keyword.as_str() {
            "$schema" | "$defs" | "title" | "description" | "default" | "format" => true,
            "$ref" => fits(root.pointer(rule.as_str().unwrap().strip_prefix('#').unwrap()).unwrap()),
            "anyOf" => rule.as_array().unwrap().iter().any(fits),
            "oneOf" => rule.as_array().unwrap().iter().filter(|one| fits(one)).count() == 1,
            "allOf" => rule.as_array().unwrap().iter().all(fits),
            "const" => value == rule,
            "enum" => rule.as_array().unwrap().contains(value),
            "minimum" => value.as_f64().is_none_or(|number| number >= rule.as_f64().unwrap()),
            "maximum" => value.as_f64().is_none_or(|number| number <= rule.as_f64().unwrap()),
            "minItems" => value.as_array().is_none_or(|list| list.len() as u64 >= rule.as_u64().unwrap()),
            "maxItems" => value.as_array().is_none_or(|list| list.len() as u64 <= rule.as_u64().unwrap()),
            "uniqueItems" => value.as_array().is_none_or(|list| {
                list.iter().enumerate().all(|(index, item)| !list[..index].contains(item))
            }),
            "type" => match rule {
                Value::Array(types) => types.iter().any(|one| is(one.as_str().unwrap(), value)),
                one => is(one.as_str().unwrap(), value),
            },
            "required" => {
                for name in rule.as_array().unwrap() {
                    let name = name.as_str().unwrap();
                    if value.is_object() && value.get(name).is_none() {
                        misfits.push(format!("{at}/{name}"));
                    }
                }
                true
            }
            "properties" => {
                for (name, schema) in rule.as_object().unwrap() {
                    if let Some(value) = value.get(name) {
                        check(schema, value, root, &format!("{at}/{name}"), misfits);
                    }
                }
                true
            }
            "additionalProperties" => {
                let known = schema.get("properties");
                for (name, value) in value.as_object().into_iter().flatten() {
                    if known.and_then(|known| known.get(name)).is_none() {
                        check(rule, value, root, &format!("{at}/{name}"), misfits);
                    }
                }
                true
            }
            "items" => {
                for (index, value) in value.as_array().into_iter().flatten().enumerate() {
                    check(rule, value, root, &format!("{at}/{index}"), misfits);
                }
                true
            }
            unknown => {
                misfits.push(format!("{at}: keyword {unknown}"));
                true
            }
        };
        if !ok {
            misfits.push(at.into());
        }
    }
}

fn is(kind: &str, value: &Value) -> bool {
    match kind {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "null" => value.is_null(),
        "number" => value.is_number(),
        "integer" => value.is_u64() || value.is_i64(),
        _ => panic!("no type of JSON: {kind}"),
    }
}

fn misfits(value: &Value) -> Vec<String> {
    let schema = json_schema();
    let mut misfits = Vec::new();
    check(&schema, value, &schema, "", &mut misfits);
    misfits
}

fn sound() -> Value {
    serde_json::to_value(example()).unwrap()
}

#[test]
fn the_example_fits() {
    assert_eq!(misfits(&sound()), Vec::<String>::new());
}

#[test]
fn every_field_is_described() {
    fn walk(schema: &Value, at: &str, bare: &mut Vec<String>) {
        if let Some(properties) = schema.get("properties").and_then(Value::as_object) {
            for (name, property) in properties {
                let tag = property.get("const").is_some();
                if !tag && property.get("description").is_none() {
                    bare.push(format!("{at}/{name}"));
                }
            }
        }
        match schema {
            Value::Object(fields) => {
                fields.iter().for_each(|(name, field)| walk(field, &format!("{at}/{name}"), bare));
            }
            Value::Array(items) => items.iter().for_each(|item| walk(item, at, bare)),
            _ => {}
        }
    }
    let mut bare = Vec::new();
    walk(&json_schema(), "", &mut bare);
    assert_eq!(bare, Vec::<String>::new());
}

#[test]
fn a_damaged_record_does_not_fit() {
    let first_launch = "/results/0/views/0/samples/0/depths/0";
    for (at, damage) in [
        ("/schema", json!("1")),
        ("/schema", json!(-1)),
        ("/started", json!(0)),
        ("/device/kind", json!("gpu")),
        ("/device/limits/workgroup_size", json!([1, 2])),
        ("/parameters/ploc.radius", json!([8])),
        ("/results/0/scene/source", json!({"kind": "rumour"})),
        ("/results/0/kernels", json!({})),
        ("/results/0/kernels/0/registers", json!(40.5)),
        ("/results/0/kernels/0/limited_by", json!("boredom")),
        ("/results/0/views/0/before/throttle_reasons/0", json!("boredom")),
        ("/results/0/views/0/counters/depths/0/utilization", json!({"subgroup_size": 32})),
        ("/results/0/views/0/counters/depths/0/utilization/fetches", json!(0.5)),
        (first_launch, json!({"rays": 5})),
        (first_launch, json!({"rays": 5, "milliseconds": null})),
        (first_launch, json!({"rays": 0.5, "milliseconds": 1.0})),
    ] {
        let mut value = sound();
        *value.pointer_mut(at).unwrap_or_else(|| panic!("no {at}")) = damage.clone();
        assert!(!misfits(&value).is_empty(), "{damage} at {at} fits");
    }
}

#[test]
fn a_method_is_paths_where_none_is_named() {
    let mut value = sound();
    assert!(value["run"].get("method").is_none());
    assert_eq!(serde_json::from_value::<Record>(value.clone()).unwrap().run.method, Method::Paths);
    value["run"]["method"] = json!("replay");
    assert_eq!(misfits(&value), Vec::<String>::new());
    let record: Record = serde_json::from_value(value.clone()).unwrap();
    assert_eq!(record.run.method, Method::Replay);
    assert_eq!(serde_json::to_value(record).unwrap()["run"]["method"], "replay");
    value["run"]["method"] = json!("guess");
    assert!(!misfits(&value).is_empty());
}

#[test]
fn what_a_reader_needs_is_required() {
    for name in ["schema", "tool", "started", "host", "device", "run", "results", "shaders"] {
        let mut value = sound();
        value.as_object_mut().unwrap().remove(name);
        assert_eq!(misfits(&value), [format!("/{name}")]);
    }
    let mut value = sound();
    value.as_object_mut().unwrap().remove("finished");
    // As in records from before kernels were kept.
    value["results"][0].as_object_mut().unwrap().remove("kernels").unwrap();
    assert_eq!(misfits(&value), Vec::<String>::new());
    assert!(serde_json::from_value::<Record>(value).unwrap().results[0].kernels.is_empty());
    // As in records from before steps were counted.
    let mut value = sound();
    let count = value["results"][0]["views"][0]["counters"]["depths"][0].as_object_mut().unwrap();
    count.remove("utilization").unwrap();
    assert_eq!(misfits(&value), Vec::<String>::new());
    let record = serde_json::from_value::<Record>(value.clone()).unwrap();
    assert_eq!((record.validate(), serde_json::to_value(record).unwrap()), (Ok(()), value));
    let mut value = sound();
    let kernel = value["results"][0]["kernels"][0].as_object_mut().unwrap();
    kernel.retain(|name, _| ["name", "purpose", "workgroup_size", "subgroup_size"].contains(&name.as_str()));
    assert_eq!(misfits(&value), Vec::<String>::new());
}
