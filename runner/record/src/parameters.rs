use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

/// Parameters by name, flattened: `ploc.radius`, `collapse.c_t`, `trace.workgroup.primary`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Parameters(pub BTreeMap<String, Value>);

/// The value of a parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Value {
    /// Yes or no.
    Bool(bool),
    /// A number, whole or not.
    Number(serde_json::Number),
    /// A word, such as the name of an enum's variant.
    Text(String),
}

impl Parameters {
    /// The value of one parameter.
    pub fn get(&self, name: &str) -> Option<&Value> {
        self.0.get(name)
    }

    /// Sets one parameter.
    pub fn set(&mut self, name: impl Into<String>, value: impl Into<Value>) {
        self.0.insert(name.into(), value.into());
    }

    /// Adds every field of a stage's `Params` under the stage's name. Nested structs become longer
    /// names (`trace.workgroup.primary`), list elements are numbered from 0, an absent `Option`
    /// becomes the word `none`.
    pub fn add(&mut self, stage: &str, params: &impl Serialize) -> Result<(), serde_json::Error> {
        // By way of text, in which an f32 of 0.1 is "0.1": a direct conversion would widen it to
        // 0.10000000149011612.
        let text = serde_json::to_string(params)?;
        self.flatten(stage, serde_json::from_str(&text)?);
        Ok(())
    }

    fn flatten(&mut self, name: &str, json: serde_json::Value) {
        match json {
            serde_json::Value::Null => self.set(name, "none"),
            serde_json::Value::Bool(value) => self.set(name, value),
            serde_json::Value::Number(value) => self.set(name, Value::Number(value)),
            serde_json::Value::String(value) => self.set(name, value),
            serde_json::Value::Array(values) => {
                for (index, value) in values.into_iter().enumerate() {
                    self.flatten(&format!("{name}.{index}"), value);
                }
            }
            serde_json::Value::Object(fields) => {
                for (field, value) in fields {
                    self.flatten(&format!("{name}.{field}"), value);
                }
            }
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Bool(value) => value.fmt(out),
            Value::Number(value) => value.fmt(out),
            Value::Text(value) => value.fmt(out),
        }
    }
}

impl From<bool> for Value {
    fn from(value: bool) -> Value {
        Value::Bool(value)
    }
}

impl From<u32> for Value {
    fn from(value: u32) -> Value {
        Value::Number(value.into())
    }
}

impl From<u64> for Value {
    fn from(value: u64) -> Value {
        Value::Number(value.into())
    }
}

impl From<f64> for Value {
    /// JSON has no infinity; it becomes the word `inf`.
    fn from(value: f64) -> Value {
        serde_json::Number::from_f64(value).map_or_else(|| Value::Text(value.to_string()), Value::Number)
    }
}

impl From<&str> for Value {
    fn from(value: &str) -> Value {
        Value::Text(value.into())
    }
}

impl From<String> for Value {
    fn from(value: String) -> Value {
        Value::Text(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize)]
    struct Trace {
        workgroup: Workgroup,
        refill: f32,
        language: &'static str,
        quota: Option<u32>,
        order: [u8; 2],
        speculative: bool,
        seed: u64,
    }

    #[derive(Serialize)]
    struct Workgroup {
        primary: u32,
    }

    #[test]
    fn a_struct_is_flattened_to_names_and_values() {
        let mut parameters = Parameters::default();
        let trace = Trace {
            workgroup: Workgroup { primary: 640 },
            refill: 0.1,
            language: "glsl",
            quota: None,
            order: [3, 1],
            speculative: true,
            seed: u64::MAX,
        };
        parameters.add("trace", &trace).unwrap();
        let expected = [
            ("trace.language", Value::from("glsl")),
            ("trace.order.0", Value::from(3u32)),
            ("trace.order.1", Value::from(1u32)),
            ("trace.quota", Value::from("none")),
            ("trace.refill", Value::from(0.1)),
            ("trace.seed", Value::from(u64::MAX)),
            ("trace.speculative", Value::from(true)),
            ("trace.workgroup.primary", Value::from(640u32)),
        ];
        let expected = expected.map(|(name, value)| (name.to_string(), value));
        assert_eq!(parameters.0, BTreeMap::from(expected));
    }

    #[test]
    fn values_keep_their_type_in_json() {
        let text = r#"{"a":2.0,"b":2,"c":true,"d":"2"}"#;
        let parameters: Parameters = serde_json::from_str(text).unwrap();
        assert_eq!(parameters.get("a"), Some(&Value::from(2.0)));
        assert_eq!(parameters.get("b"), Some(&Value::from(2u32)));
        assert_eq!(serde_json::to_string(&parameters).unwrap(), text);
    }

    #[test]
    fn infinity_becomes_a_word() {
        assert_eq!(Value::from(f64::INFINITY), Value::from("inf"));
    }
}
