//! Holds a document against the JSON Schema: unknown keys, wrong kinds, numbers out of range. So the schema
//! cannot know other keys than the program, and all mistakes of this sort are found at once.

use super::source::{Mistakes, instead};
use serde_json::Value;
use std::ops::Range;
use toml::{
    Spanned,
    de::{DeTable, DeValue},
};

/// Notes what is wrong with a document.
pub fn check(document: &Spanned<DeTable<'_>>, schema: &Value, mistakes: &mut Mistakes) {
    table("the file", document.span(), document.get_ref(), schema, mistakes);
}

/// `what` is how messages call it.
fn value(what: &str, entry: &Spanned<DeValue<'_>>, schema: &Value, mistakes: &mut Mistakes) {
    let span = entry.span();
    let kinds = kinds(schema);
    let kind = kind(entry.get_ref());
    let fits = kinds.contains(&kind) || (kind == "integer" && kinds.contains(&"number"));
    if !fits {
        mistakes.add(span, format_args!("{what} is {}, not {}", described(schema), word(kind)));
        return;
    }
    match entry.get_ref() {
        DeValue::Table(entries) => table(what, span, entries, schema, mistakes),
        DeValue::Array(entries) => {
            if entries.is_empty() && schema["minItems"].as_u64() > Some(0) {
                mistakes.add(span, format_args!("{what} is empty"));
            }
            let items = &schema["items"];
            let each = match self::kinds(items).as_slice() {
                ["object"] => format!("`[[{}]]`", what.trim_matches('`')),
                _ => format!("each of {what}"),
            };
            for entry in entries.iter() {
                value(&each, entry, items, mistakes);
            }
        }
        DeValue::Integer(integer) => {
            let number = i128::from_str_radix(integer.as_str(), integer.radix()).unwrap_or(i128::MAX) as f64;
            let below = schema["minimum"].as_f64().is_some_and(|least| number < least);
            if below || schema["maximum"].as_f64().is_some_and(|most| number > most) {
                mistakes.add(span, format_args!("{what} is {}, not {integer}", described(schema)));
            }
        }
        DeValue::String(text) => {
            let known = schema["enum"].as_array().map(|words| words.iter().filter_map(Value::as_str));
            if let Some(mut known) = known
                && !known.clone().any(|word| word == text)
            {
                mistakes.add(span, format_args!("there is no {what} {text:?}{}", instead(text, &mut known)));
            }
        }
        DeValue::Float(_) | DeValue::Boolean(_) | DeValue::Datetime(_) => {}
    }
}

fn table(what: &str, span: Range<usize>, entries: &DeTable<'_>, schema: &Value, mistakes: &mut Mistakes) {
    let empty = serde_json::Map::new();
    let known = schema["properties"].as_object().unwrap_or(&empty);
    for (key, entry) in entries {
        let name = key.get_ref().as_ref();
        if let Some(schema) = known.get(name) {
            value(&format!("`{name}`"), entry, schema, mistakes);
        } else if let Some(quoted) = quoted(name, entry.get_ref(), known) {
            let message = format!("write the name of a parameter in quotes: \"{quoted}\" = …");
            mistakes.add(key.span(), message);
        } else {
            let instead = instead(name, known.keys().map(String::as_str));
            mistakes.add(key.span(), format_args!("{what} has no key `{name}`{instead}"));
        }
    }
    for missing in schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str) {
        if !entries.contains_key(missing) {
            mistakes.add(span.clone(), format_args!("{what} needs the key `{missing}`"));
        }
    }
}

/// `collapse.c_t = 3` without quotes is a table `collapse`: the name that was meant.
fn quoted(name: &str, entry: &DeValue<'_>, known: &serde_json::Map<String, Value>) -> Option<String> {
    let inner = entry.as_table()?.keys().next()?.get_ref();
    let whole = format!("{name}.{inner}");
    known.contains_key(&whole).then_some(whole)
}

/// The kinds that a schema allows.
pub fn kinds(schema: &Value) -> Vec<&str> {
    match &schema["type"] {
        Value::String(kind) => vec![kind],
        Value::Array(kinds) => kinds.iter().filter_map(Value::as_str).collect(),
        _ => Vec::new(),
    }
}

/// What a value is in the words of JSON Schema.
fn kind(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "string",
        DeValue::Integer(_) => "integer",
        DeValue::Float(_) => "number",
        DeValue::Boolean(_) => "boolean",
        DeValue::Datetime(_) => "date",
        DeValue::Array(_) => "array",
        DeValue::Table(_) => "object",
    }
}

/// The same for people.
fn word(kind: &str) -> &str {
    match kind {
        "string" => "text",
        "integer" => "a whole number",
        "number" => "a number",
        "boolean" => "true or false",
        "array" => "a list",
        "object" => "a table",
        other => other,
    }
}

/// What a schema allows, for people.
fn described(schema: &Value) -> String {
    let mut words: Vec<String> = kinds(schema).into_iter().map(|kind| word(kind).to_owned()).collect();
    let (least, most) = (schema["minimum"].as_f64(), schema["maximum"].as_f64());
    let first = words.first_mut().expect("every value has a kind");
    match (least, most) {
        (Some(least), Some(most)) if most < f64::from(u32::MAX) => {
            *first += &format!(" from {least} to {most}")
        }
        (Some(least), _) => *first += &format!(" from {least}"),
        _ => {}
    }
    let mut words = words.join(" or ");
    if let Some(example) = schema["examples"].get(0).filter(|example| !example.is_number()) {
        words += &format!(" such as {example}");
    }
    words
}
