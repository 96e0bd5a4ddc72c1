//! Several records as one.

use record::Record;

/// All points of several records of one device; each point keeps the parameters that held for it. Of a point that
/// several have, the first one counts.
///
/// # Errors
/// They are of different devices, whose rates do not belong into one picture.
pub fn join(records: &[Record]) -> anyhow::Result<Record> {
    let Some((first, others)) = records.split_first() else {
        anyhow::bail!("there is no record");
    };
    let mut joined = first.clone();
    if let Some(other) = others.iter().find(|other| other.device.name != first.device.name) {
        anyhow::bail!(
            "the records are of different devices, {} and {}: draw them one by one",
            first.device.name,
            other.device.name
        );
    }
    for other in others {
        for point in &other.results {
            let mut point = point.clone();
            point.parameters = other.parameters_of(&point);
            let known = joined.results.iter().any(|old| {
                old.scene.name == point.scene.name
                    && old.scene.parameters() == point.scene.parameters()
                    && old.variant == point.variant
                    && joined.parameters_of(old) == joined.parameters_of(&point)
            });
            if !known {
                joined.results.push(point);
            }
        }
        joined.references.extend(other.references.iter().cloned());
    }
    Ok(joined)
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::example;

    #[test]
    fn scenes_of_several_records_come_together() {
        let mut other = example();
        other.results.truncate(1);
        other.results[0].scene.name = "city".into();
        other.parameters.set("ploc.radius", 16u32);
        let joined = join(&[example(), other.clone(), other]).unwrap();
        assert_eq!(joined.results.len(), 3);
        assert_eq!(joined.results[2].parameters.get("ploc.radius"), Some(&16u32.into()));
    }

    #[test]
    fn devices_are_kept_apart() {
        let mut other = example();
        other.device.name = "Another".into();
        let error = join(&[example(), other]).unwrap_err().to_string();
        assert!(error.contains("Another") && error.contains("one by one"), "{error}");
        assert!(join(&[]).is_err());
    }
}
