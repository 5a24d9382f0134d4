//! Who depends on whom, from `cargo metadata`.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use anyhow::{Context as _, ensure};
use serde_json::Value;

use crate::workspace;

/// The resolved packages, workspace and registry alike.
#[derive(Debug, Default)]
pub(super) struct Graph {
    packages: BTreeMap<String, Package>,
}

#[derive(Debug, Default)]
struct Package {
    name: String,
    /// Folder below the root, for packages of the workspace.
    member: Option<String>,
    needs: Vec<Edge>,
}

#[derive(Debug)]
struct Edge {
    id: String,
    /// Only for tests, examples and benches.
    dev: bool,
}

impl Graph {
    pub(super) fn of_workspace() -> anyhow::Result<Self> {
        let run = workspace::cargo().args(["metadata", "--format-version=1"]).output()?;
        ensure!(
            run.status.success(),
            "cargo metadata failed: {}",
            String::from_utf8_lossy(&run.stderr)
        );
        Self::parse(&serde_json::from_slice(&run.stdout)?)
            .context("cargo metadata has another shape than expected")
    }

    fn parse(metadata: &Value) -> Option<Self> {
        let root = metadata["workspace_root"].as_str()?;
        let members: BTreeSet<&str> =
            metadata["workspace_members"].as_array()?.iter().filter_map(Value::as_str).collect();
        let mut packages = BTreeMap::new();
        for package in metadata["packages"].as_array()? {
            let (id, manifest) = (package["id"].as_str()?, package["manifest_path"].as_str()?);
            let folder = || {
                manifest.strip_prefix(root)?.strip_suffix("/Cargo.toml").map(|f| f[1..].to_owned())
            };
            let member = if members.contains(id) { folder() } else { None };
            let name = package["name"].as_str()?.to_owned();
            packages.insert(id.to_owned(), Package { name, member, needs: Vec::new() });
        }
        for node in metadata["resolve"]["nodes"].as_array()? {
            let mut needs = Vec::new();
            for dep in node["deps"].as_array()? {
                // A package may be needed twice, for the library and for its tests.
                let dev = dep["dep_kinds"].as_array()?.iter().all(|kind| kind["kind"] == "dev");
                needs.push(Edge { id: dep["pkg"].as_str()?.into(), dev });
            }
            packages.get_mut(node["id"].as_str()?)?.needs = needs;
        }
        Some(Self { packages })
    }

    /// Name and folder of every package of the workspace.
    pub(super) fn members(&self) -> impl Iterator<Item = (&str, &str)> {
        self.packages.values().filter_map(|p| Some((p.name.as_str(), p.member.as_deref()?)))
    }

    /// Packages that `member` names in its manifest, for tests too.
    pub(super) fn direct(&self, member: &str) -> Vec<&str> {
        self.member(member)
            .into_iter()
            .flat_map(|p| &p.needs)
            .map(|edge| self.name(&edge.id))
            .collect()
    }

    /// The shortest way from `member` to a package whose name starts with `prefix`, both included. Follows what
    /// building and testing `member` compiles: its own dev-dependencies, not those of others.
    pub(super) fn way(&self, member: &str, prefix: &str) -> Option<Vec<&str>> {
        let start =
            self.packages.iter().find(|(_, p)| p.name == member && p.member.is_some())?.0.as_str();
        let mut came_from = BTreeMap::from([(start, None)]);
        let mut queue = VecDeque::from([start]);
        while let Some(id) = queue.pop_front() {
            if id != start && self.name(id).starts_with(prefix) {
                let mut way = vec![self.name(id)];
                let mut at = id;
                while let Some(&Some(previous)) = came_from.get(at) {
                    way.push(self.name(previous));
                    at = previous;
                }
                way.reverse();
                return Some(way);
            }
            for edge in self
                .packages
                .get(id)
                .into_iter()
                .flat_map(|p| &p.needs)
                .filter(|e| !e.dev || id == start)
            {
                if !came_from.contains_key(edge.id.as_str()) {
                    came_from.insert(&edge.id, Some(id));
                    queue.push_back(&edge.id);
                }
            }
        }
        None
    }

    fn member(&self, name: &str) -> Option<&Package> {
        self.packages.values().find(|p| p.name == name && p.member.is_some())
    }

    fn name<'a>(&'a self, id: &'a str) -> &'a str {
        self.packages.get(id).map_or(id, |p| p.name.as_str())
    }

    /// `"a -> b c, dev d"` per line; packages with a `palpate` or `xtask` name are of the workspace.
    #[cfg(test)]
    pub(super) fn sketch(text: &str) -> Self {
        let mut graph = Self::default();
        for line in text.lines().filter(|line| !line.trim().is_empty()) {
            let (name, needs) = line.split_once("->").unwrap();
            let (plain, dev) = needs.split_once(", dev ").unwrap_or((needs, ""));
            let edges = [(plain, false), (dev, true)]
                .iter()
                .flat_map(|&(list, dev)| {
                    list.split_whitespace().map(move |id| Edge { id: id.into(), dev })
                })
                .collect();
            let name = name.trim();
            let ours = name.starts_with("palpate") || name == "xtask";
            let member = ours.then(|| format!("crates/{name}"));
            graph.packages.insert(name.into(), Package { name: name.into(), member, needs: edges });
        }
        graph
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metadata_is_read() {
        let metadata: Value = serde_json::from_str(
            r#"{"workspace_root": "/r", "workspace_members": ["id-a"], "packages": [
                {"id": "id-a", "name": "a", "manifest_path": "/r/crates/a/Cargo.toml"},
                {"id": "id-b", "name": "b", "manifest_path": "/elsewhere/b/Cargo.toml"},
                {"id": "id-c", "name": "c", "manifest_path": "/elsewhere/c/Cargo.toml"}],
              "resolve": {"nodes": [
                {"id": "id-a", "deps": [
                    {"pkg": "id-b", "dep_kinds": [{"kind": null}, {"kind": "dev"}]},
                    {"pkg": "id-c", "dep_kinds": [{"kind": "dev"}]}]},
                {"id": "id-b", "deps": []}, {"id": "id-c", "deps": []}]}}"#,
        )
        .unwrap();
        let graph = Graph::parse(&metadata).unwrap();
        assert_eq!(graph.members().collect::<Vec<_>>(), [("a", "crates/a")]);
        assert_eq!(graph.direct("a"), ["b", "c"]);
        let a = graph.member("a").unwrap();
        assert_eq!(a.needs.iter().map(|e| e.dev).collect::<Vec<_>>(), [false, true]);
    }

    #[test]
    fn a_way_follows_only_its_own_dev_dependencies() {
        let graph =
            Graph::sketch("palpate-a -> x, dev y\nx -> , dev heavy\ny -> z\nz -> heavy\nheavy -> ");
        assert_eq!(graph.way("palpate-a", "heavy").unwrap(), ["palpate-a", "y", "z", "heavy"]);
        let graph = Graph::sketch("palpate-a -> x\nx -> , dev heavy\nheavy -> ");
        assert_eq!(graph.way("palpate-a", "heavy"), None);
    }
}
