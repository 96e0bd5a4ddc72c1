//! Values of parameters, in the one form in which they are compared.

use crate::params::Params;
use anyhow::anyhow;
use record::{Parameters, Value};

/// A value of a parameter as the parameter holds it: 3 and 3.0 are one.
///
/// # Errors
/// The parameter does not exist, or cannot have that value.
pub fn of(parameter: &str, value: &serde_json::Value) -> anyhow::Result<Value> {
    let mut params = Params::default();
    params.assign(parameter, value.clone()).map_err(|error| anyhow!("{error:#}"))?;
    let held = params.by_name().0.remove(parameter);
    held.ok_or_else(|| anyhow!("there is no parameter {parameter}"))
}

/// A value in few characters.
pub fn text(value: &Value) -> String {
    let text = value.to_string();
    match value {
        Value::Number(_) => text.strip_suffix(".0").map(str::to_owned).unwrap_or(text),
        _ => text,
    }
}

/// A value as TOML.
pub fn toml(value: &Value) -> String {
    match value {
        Value::Text(word) => toml::Value::from(word.as_str()).to_string(),
        value => text(value),
    }
}

/// Several for a message.
pub fn list<'v>(values: impl IntoIterator<Item = &'v Value>) -> String {
    values.into_iter().map(text).collect::<Vec<_>>().join(", ")
}

/// Gives parameters values that were checked when they were read.
///
/// # Errors
/// They were not.
pub fn assign(params: &mut Params, values: &Parameters) -> anyhow::Result<()> {
    for (name, value) in &values.0 {
        params.assign(name, serde_json::to_value(value)?)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_value_is_what_the_parameter_holds() {
        assert_eq!(of("collapse.c_t", &json!(3)).unwrap(), of("collapse.c_t", &json!(3.0)).unwrap());
        assert_eq!(text(&of("collapse.c_t", &json!(3)).unwrap()), "3");
        assert_eq!(text(&of("contract.alpha", &json!(0.1)).unwrap()), "0.1");
        assert_eq!(toml(&of("trace.kernels", &json!("single")).unwrap()), "\"single\"");
        assert!(of("trace.kernels", &json!("twin")).is_err());
        assert!(of("cbtc.subsampling", &json!(0)).is_err());
        assert!(of("cbtc.subsample", &json!(1)).is_err());
    }
}
