//! Which crate may depend on which (ARCHITECTURE.md, "Invariants" 1–3).

use super::Finding;
use super::graph::Graph;

/// What each package may name of ours, in its dependencies and dev-dependencies. In reading order.
const MAY_NEED: &[(&str, &[&str])] = &[
    ("palpate-spatial", &[]),
    ("palpate-kinematics", &["palpate-spatial"]),
    ("palpate-control", &["palpate-spatial"]),
    // The API boundary between this project and an arm.
    ("palpate-robot-io", &["palpate-spatial"]),
    (
        "palpate-safety",
        &["palpate-spatial", "palpate-kinematics", "palpate-control", "palpate-robot-io"],
    ),
    // A backend knows no task …
    ("palpate-sim", &["palpate-spatial", "palpate-kinematics", "palpate-robot-io"]),
    ("palpate-ur", &["palpate-spatial", "palpate-kinematics", "palpate-robot-io"]),
    // The other end of the wire: the protocol, and the simulator's contact behind a feature.
    (
        "palpate-virtual-ur",
        &["palpate-spatial", "palpate-kinematics", "palpate-robot-io", "palpate-ur", "palpate-sim"],
    ),
    // … and a task knows no backend.
    (
        "palpate-env",
        &[
            "palpate-spatial",
            "palpate-kinematics",
            "palpate-control",
            "palpate-robot-io",
            "palpate-safety",
        ],
    ),
    // The learner knows no robot, the run directory neither.
    ("palpate-sac", &[]),
    ("palpate-runs", &[]),
    // Neither does a recording: frames, shapes and numbers.
    ("palpate-record", &["palpate-spatial"]),
    ("palpate", ANY),
    ("palpate-examples", ANY),
    // It shells out: `cargo xtask` must build in seconds.
    ("xtask", &[]),
];

const ANY: &[&str] = &["*"];

/// Engines, by the start of their package names, and who may name them.
const ENGINES: &[(&str, &[&str])] =
    &[("candle", &["palpate-sac", "palpate"]), ("rapier", &["palpate-sim"])];

/// What must never be compiled to build or test [`LIGHT`].
const HEAVY: &[&str] = &["candle", "rapier", "tokio"];

/// Packages whose tests start within seconds.
const LIGHT: &[&str] = &[
    "palpate-spatial",
    "palpate-kinematics",
    "palpate-control",
    "palpate-robot-io",
    "palpate-safety",
    "palpate-env",
    "palpate-record",
    "xtask",
];

const ARCHITECTURE: &str = "ARCHITECTURE.md, \"Invariants\"";

pub(super) fn check(graph: &Graph) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (name, folder) in graph.members() {
        let manifest = format!("{folder}/Cargo.toml");
        let mut found = |problem: String, remedy: String| {
            findings.push(Finding::new(&manifest, None, problem, remedy));
        };
        let direct = graph.direct(name);
        match MAY_NEED.iter().find(|(package, _)| *package == name) {
            None => found(
                format!("{name} has no place in the layering"),
                "say what it may depend on in xtask/src/tidy/layering.rs and in ARCHITECTURE.md's code map".into(),
            ),
            Some((_, allowed)) => {
                let ours = |d: &&&str| MAY_NEED.iter().any(|(package, _)| package == *d);
                for needed in direct.iter().filter(ours).filter(|d| *allowed != ANY && !allowed.contains(d)) {
                    found(
                        format!("{name} may not depend on {needed}"),
                        format!("move the code that needs it to a crate above both; the rule is in {ARCHITECTURE}"),
                    );
                }
            }
        }
        for (engine, holders) in ENGINES.iter().filter(|(_, holders)| !holders.contains(&name)) {
            for needed in direct.iter().filter(|d| d.starts_with(engine)) {
                found(
                    format!("{name} may not depend on {needed}"),
                    format!("only {} may; go through it ({ARCHITECTURE})", holders.join(" and ")),
                );
            }
        }
        for heavy in HEAVY.iter().filter(|_| LIGHT.contains(&name)) {
            if let Some(way) = graph.way(name, heavy) {
                found(
                    format!("building {name} compiles {heavy}: {}", way.join(" → ")),
                    format!(
                        "cut the chain, or make it a feature that is off: {name} must build in seconds"
                    ),
                );
            }
        }
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problems(sketch: &str) -> Vec<String> {
        check(&Graph::sketch(sketch))
            .into_iter()
            .map(|f| format!("{}: {}", f.path, f.problem))
            .collect()
    }

    #[test]
    fn the_layering_as_drawn_passes() {
        let found = problems(
            "palpate-spatial -> nalgebra
palpate-robot-io -> palpate-spatial
palpate-safety -> palpate-robot-io palpate-control
palpate-sim -> palpate-robot-io rapier3d-f64
palpate-env -> palpate-safety, dev toml
palpate-sac -> candle-core candle-nn
palpate -> palpate-sim palpate-sac candle-core
palpate-control -> palpate-spatial
rapier3d-f64 -> nalgebra
candle-core ->
candle-nn -> candle-core
nalgebra ->
toml ->",
        );
        assert_eq!(found, [] as [&str; 0]);
    }

    #[test]
    fn each_forbidden_edge_is_found() {
        for (sketch, problem) in [
            (
                "palpate-robot-io -> palpate-kinematics\npalpate-kinematics ->",
                "palpate-robot-io may not depend on palpate-kinematics",
            ),
            (
                "palpate-env -> , dev palpate-sim\npalpate-sim ->",
                "palpate-env may not depend on palpate-sim",
            ),
            (
                "palpate-sac -> palpate-spatial\npalpate-spatial ->",
                "palpate-sac may not depend on palpate-spatial",
            ),
            (
                "palpate-runs -> candle-core\ncandle-core ->",
                "palpate-runs may not depend on candle-core",
            ),
            ("palpate -> rapier3d-f64\nrapier3d-f64 ->", "palpate may not depend on rapier3d-f64"),
            ("xtask -> palpate-runs\npalpate-runs ->", "xtask may not depend on palpate-runs"),
            ("palpate-new ->", "palpate-new has no place in the layering"),
        ] {
            let found = problems(sketch);
            assert!(found.len() == 1 && found[0].ends_with(problem), "{sketch}: {found:?}");
            assert!(found[0].starts_with("crates/"), "{found:?}");
        }
    }

    #[test]
    fn a_heavy_crate_behind_a_third_party_is_found() {
        let found = problems("palpate-safety -> innocent\ninnocent -> tokio-util\ntokio-util ->");
        assert_eq!(
            found,
            [
                "crates/palpate-safety/Cargo.toml: building palpate-safety compiles tokio: palpate-safety → innocent → tokio-util"
            ]
        );
    }
}
