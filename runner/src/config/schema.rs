//! The JSON Schema of configs.

use super::document::Document;
use crate::{params::Params, variant::Variant};
use schemars::{
    Schema, SchemaGenerator, generate::SchemaSettings, json_schema, transform::RecursiveTransform,
};
use serde_json::{Map, Value, json};
use std::sync::LazyLock;

/// What the value of a parameter may be.
pub static SCALAR: LazyLock<Value> = LazyLock::new(|| json!({ "type": ["number", "string", "boolean"] }));

/// The JSON Schema of configs, without references to other parts of itself.
pub static SCHEMA: LazyLock<Value> = LazyLock::new(|| {
    let mut settings = SchemaSettings::draft07().with_transform(RecursiveTransform(without_null));
    settings.inline_subschemas = true;
    let mut schema = settings.into_generator().into_root_schema_for::<Document>();
    schema.insert("title".into(), "Broadleaf experiment".into());
    schema.to_value()
});

/// TOML has no null: what may be absent is not mentioned.
fn without_null(schema: &mut Schema) {
    if schema.get("default").is_some_and(Value::is_null) {
        schema.remove("default");
    }
    if let Some(Value::Array(types)) = schema.get_mut("type") {
        types.retain(|kind| kind != "null");
        if let [only] = types.as_slice() {
            let only = only.clone();
            schema.insert("type".into(), only);
        }
    }
}

/// Every parameter and how JSON Schema calls the kind of its value.
fn kinds() -> impl Iterator<Item = (String, &'static str)> {
    Params::default().by_name().0.into_iter().map(|(name, value)| {
        let kind = match value {
            record::Value::Bool(_) => "boolean",
            record::Value::Number(number) if number.is_f64() => "number",
            record::Value::Number(_) => "integer",
            record::Value::Text(_) => "string",
        };
        (name, kind)
    })
}

/// The name of a parameter.
pub fn parameter(_: &mut SchemaGenerator) -> Schema {
    let names: Vec<_> = kinds().map(|(name, _)| name).collect();
    json_schema!({ "type": "string", "enum": names })
}

/// Values of parameters.
pub fn parameters(_: &mut SchemaGenerator) -> Schema {
    let properties: Map<_, _> = kinds().map(|(name, kind)| (name, json!({ "type": kind }))).collect();
    json_schema!({ "type": "object", "properties": properties, "additionalProperties": false })
}

/// A condition on scene, variant and axes.
pub fn when(_: &mut SchemaGenerator) -> Schema {
    let any_of = |kind: &str| json!({ "type": [kind, "array"], "items": { "type": kind }, "minItems": 1 });
    let mut properties: Map<_, _> = kinds().map(|(name, kind)| (name, any_of(kind))).collect();
    let variants: Vec<_> = Variant::ALL.iter().map(|variant| variant.name()).collect();
    for (name, description, examples) in [
        ("scene", "Scenes; `*` stands for any text.", vec!["sponza", "bistro*"]),
        ("variant", "Variants; `*` stands for any text.", [&["*CBTC"], variants.as_slice()].concat()),
    ] {
        let mut schema = any_of("string");
        schema["description"] = description.into();
        schema["examples"] = examples.into();
        properties.insert(name.into(), schema);
    }
    json_schema!({
        "type": "object",
        "properties": properties,
        "additionalProperties": false,
    })
}
