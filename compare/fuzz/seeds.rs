//! Writes the inputs that fuzzing begins with into the folder that is named.

use std::path::PathBuf;
use std::{env, fs};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(env::args_os().nth(1).ok_or("which folder?")?);
    fs::create_dir_all(&folder)?;
    let whole = record::example();
    fs::write(folder.join("whole.json"), serde_json::to_vec(&whole)?)?;
    for (index, point) in whole.results.iter().enumerate() {
        let mut one = whole.clone();
        one.results = vec![point.clone()];
        one.references.clear();
        fs::write(folder.join(format!("point{index}.json")), serde_json::to_vec(&one)?)?;
    }
    let mut head = whole.clone();
    let points = std::mem::take(&mut head.results);
    let mut journal = serde_json::to_string(&serde_json::json!({ "record": head, "points": ["a", "b"] }))?;
    // The number comes first, as the runner writes it.
    journal.insert_str(1, "\"journal\":1,");
    for (key, point) in ["a", "b"].iter().zip(&points) {
        journal += "\n";
        journal += &serde_json::to_string(&serde_json::json!({ "key": key, "point": point }))?;
    }
    fs::write(folder.join("journal.jsonl"), journal + "\n")?;
    Ok(())
}
