//! Tables of settings as single keys.

use std::collections::BTreeMap;

use toml::{Table, Value};

/// Every key of a table with the tables it is in, and its value as TOML: `sac.gamma` and `0.98`.
pub(crate) fn flat(table: &Table) -> BTreeMap<String, String> {
    let mut keys = BTreeMap::new();
    for (key, value) in table {
        add(key, value, &mut keys);
    }
    keys
}

fn add(path: &str, value: &Value, keys: &mut BTreeMap<String, String>) {
    match value {
        Value::Table(table) => {
            for (key, value) in table {
                add(&format!("{path}.{key}"), value, keys);
            }
        }
        value => {
            keys.insert(path.to_owned(), value.to_string());
        }
    }
}
