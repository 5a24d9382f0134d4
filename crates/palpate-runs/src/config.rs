//! Layered configuration: a base text that states every key, files that change some, and
//! `key.path=value` arguments that win.
//!
//! A key that the base lacks is an error that names the nearest one. The tables called *open* are
//! exempt, because they may hold optional keys: theirs are checked when the configuration is
//! [parsed](parse). A layer that gives an open table a `name` states it as a whole and replaces the
//! base's; without a `name` it changes single keys.

use std::collections::BTreeMap;

use serde::de::DeserializeOwned;
use toml::de::{DeTable, DeValue};
use toml::{Table, Value};

/// A TOML text and what to call it in errors.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layer {
    /// A file name, or where else the text is from.
    pub name: String,
    /// TOML.
    pub text: String,
}

/// What is wrong with a configuration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// A layer is no TOML.
    #[error("{name}: {message}")]
    Syntax {
        /// The layer.
        name: String,
        /// Line, caret and reason.
        message: String,
    },
    /// A layer has a key that the base lacks.
    #[error("{place}: there is no key `{key}`{}", near.as_ref().map_or(String::new(), |near| format!("; did you mean `{near}`?")))]
    UnknownKey {
        /// Its path.
        key: String,
        /// File and line, or argument.
        place: String,
        /// The nearest key that exists.
        near: Option<String>,
    },
    /// An argument is no `key.path=value`.
    #[error("--set {argument}: {reason}")]
    Argument {
        /// The argument.
        argument: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A value does not fit its key.
    #[error("{}{message}{}", place.as_ref().map_or(String::new(), |place| format!("{place}: ")), if key.is_empty() { String::new() } else { format!(" in `{key}`") })]
    Value {
        /// The key's path, as far as it is known.
        key: String,
        /// Who stated it, if it is not the base.
        place: Option<String>,
        /// What was found and what was expected.
        message: String,
    },
}

/// A configuration in which each value won, with the places of those that changed the base.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Resolved {
    table: Table,
    places: BTreeMap<String, String>,
}

impl Resolved {
    /// The values.
    pub fn table(&self) -> &Table {
        &self.table
    }
}

/// Lays `layers` and then the arguments `set` over `base`.
pub fn resolve(
    base: &Layer,
    layers: &[Layer],
    set: &[String],
    open: &[&str],
) -> Result<Resolved, ConfigError> {
    let (table, _) = read(base)?;
    let mut keys = Vec::new();
    collect(&table, "", &mut keys);
    let mut merge = Merge { keys, open, resolved: Resolved { table, places: BTreeMap::new() } };
    for layer in layers {
        let (table, lines) = read(layer)?;
        merge.lay(table, &|key| match lines.get(key) {
            Some(line) => format!("{}:{line}", layer.name),
            None => layer.name.clone(),
        })?;
    }
    for argument in set {
        merge.lay(assignment(argument)?, &|_| format!("--set {argument}"))?;
    }
    Ok(merge.resolved)
}

/// Makes a configuration of its values. Errors name the key, and the place if a layer stated it.
pub fn parse<T: DeserializeOwned>(resolved: Resolved) -> Result<T, ConfigError> {
    let Resolved { table, places } = resolved;
    T::deserialize(Value::Table(table)).map_err(|error| {
        // The path is in the error's text only.
        let text = error.to_string();
        let path = text.trim_end().rsplit_once("in `").and_then(|(_, path)| path.strip_suffix('`'));
        let key = path.unwrap_or_default().to_owned();
        // "unknown field `x`, …" is about a key below the path.
        let field =
            error.message().strip_prefix("unknown field `").and_then(|m| m.split('`').next());
        let below = field.map(|field| join(&key, field));
        let place = below.and_then(|k| places.get(&k)).or_else(|| places.get(&key)).cloned();
        ConfigError::Value { key, place, message: error.message().to_owned() }
    })
}

/// The candidate that `wanted` is most likely a misspelling of.
pub fn nearest<'a>(wanted: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let allowed = 1 + wanted.chars().count() / 3;
    candidates
        .into_iter()
        .map(|candidate| (strsim::damerau_levenshtein(wanted, candidate), candidate))
        .filter(|(distance, _)| *distance <= allowed)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

struct Merge<'a> {
    /// Paths of the base's keys.
    keys: Vec<String>,
    open: &'a [&'a str],
    resolved: Resolved,
}

impl Merge<'_> {
    fn lay(&mut self, layer: Table, place: &dyn Fn(&str) -> String) -> Result<(), ConfigError> {
        let mut table = std::mem::take(&mut self.resolved.table);
        let done = self.merge(&mut table, layer, "", place);
        self.resolved.table = table;
        done
    }

    fn merge(
        &mut self,
        below: &mut Table,
        layer: Table,
        path: &str,
        place: &dyn Fn(&str) -> String,
    ) -> Result<(), ConfigError> {
        for (name, value) in layer {
            let key = join(path, &name);
            let whole = self.open.contains(&key.as_str())
                && value.as_table().is_some_and(|table| table.contains_key("name"));
            match (below.get_mut(&name), value) {
                (Some(Value::Table(below)), Value::Table(table)) if !whole => {
                    self.merge(below, table, &key, place)?;
                }
                (None, _) if !self.is_open(&key) => {
                    let near = nearest_key(&key, &self.keys).map(str::to_owned);
                    return Err(ConfigError::UnknownKey { place: place(&key), key, near });
                }
                (_, value) => {
                    self.place(&key, &value, place);
                    below.insert(name, value);
                }
            }
        }
        Ok(())
    }

    fn is_open(&self, key: &str) -> bool {
        self.open
            .iter()
            .any(|open| key.strip_prefix(open).is_some_and(|rest| rest.starts_with('.')))
    }

    /// Remembers who stated a value.
    fn place(&mut self, key: &str, value: &Value, place: &dyn Fn(&str) -> String) {
        self.resolved.places.insert(key.to_owned(), place(key));
        for (name, value) in value.as_table().into_iter().flatten() {
            self.place(&join(key, name), value, place);
        }
    }
}

/// A key of the same name elsewhere, or the most similar path.
fn nearest_key<'a>(wanted: &str, keys: &'a [String]) -> Option<&'a str> {
    let name = |key: &'a str| key.rsplit('.').next().unwrap_or(key);
    let keys = || keys.iter().map(String::as_str);
    let last = wanted.rsplit('.').next().unwrap_or(wanted);
    let same = keys().filter(|key| name(key) == last);
    same.min_by_key(|key| strsim::damerau_levenshtein(wanted, key))
        .or_else(|| nearest(wanted, keys()))
}

/// Parses a layer; with the lines its keys are on.
fn read(layer: &Layer) -> Result<(Table, BTreeMap<String, usize>), ConfigError> {
    let syntax = |error: &toml::de::Error| ConfigError::Syntax {
        name: layer.name.clone(),
        message: error.to_string().trim_end().to_owned(),
    };
    let table = toml::from_str(&layer.text).map_err(|e| syntax(&e))?;
    let spans = DeTable::parse(&layer.text).map_err(|e| syntax(&e))?;
    let mut lines = BTreeMap::new();
    find_lines(spans.get_ref(), "", &layer.text, &mut lines);
    Ok((table, lines))
}

fn find_lines(table: &DeTable<'_>, path: &str, text: &str, lines: &mut BTreeMap<String, usize>) {
    for (name, value) in table {
        let key = join(path, name.get_ref());
        let before = text.get(..name.span().start).unwrap_or_default();
        lines.insert(key.clone(), 1 + before.matches('\n').count());
        if let DeValue::Table(table) = value.get_ref() {
            find_lines(table, &key, text, lines);
        }
    }
}

/// `key.path=value` as a table of one value. What is no TOML value is a string, if it is one word.
fn assignment(argument: &str) -> Result<Table, ConfigError> {
    let wrong =
        |reason: &str| ConfigError::Argument { argument: argument.into(), reason: reason.into() };
    let (key, value) = argument.split_once('=').ok_or_else(|| wrong("expected key.path=value"))?;
    let (key, value) = (key.trim(), value.trim());
    let bare = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-');
    if !key.split('.').all(|part| !part.is_empty() && part.chars().all(bare)) {
        return Err(wrong("expected a key like sac.gamma before the `=`"));
    }
    if value.is_empty() {
        return Err(wrong("there is no value after the `=`"));
    }
    let error = match toml::from_str(&format!("{key} = {value}")) {
        Ok(table) if is_one(&table, key) => return Ok(table),
        Ok(_) => return Err(wrong("the value has a line break, and more keys after it")),
        Err(error) => error,
    };
    if value.chars().all(|c| bare(c) || matches!(c, '.' | '/' | '~' | '+' | ':' | '\\')) {
        let mut table = Table::new();
        let mut parts = key.rsplit('.');
        table.insert(parts.next().unwrap_or(key).into(), Value::String(value.into()));
        return Ok(
            parts.fold(table, |table, part| Table::from_iter([(part.into(), Value::Table(table))]))
        );
    }
    Err(wrong(error.message()))
}

/// Whether a table states the key and nothing beside it.
fn is_one(table: &Table, key: &str) -> bool {
    let (name, rest) = key.split_once('.').map_or((key, None), |(name, rest)| (name, Some(rest)));
    let below = |rest| table.get(name).and_then(Value::as_table).is_some_and(|t| is_one(t, rest));
    table.len() == 1 && rest.is_none_or(below)
}

fn collect(table: &Table, path: &str, keys: &mut Vec<String>) {
    for (name, value) in table {
        let key = join(path, name);
        if let Value::Table(table) = value {
            collect(table, &key, keys);
        }
        keys.push(key);
    }
}

fn join(path: &str, name: &str) -> String {
    if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") }
}

#[cfg(test)]
#[path = "config_tests.rs"]
mod tests;
