use serde::Deserialize;

use super::*;

#[derive(Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Config {
    run: Run,
    sac: Sac,
    policy: Policy,
}

#[derive(Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Run {
    seed: u64,
    name: String,
}

#[derive(Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sac {
    gamma: f64,
    batch_size: usize,
    hidden: Vec<usize>,
}

#[derive(Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Policy {
    name: String,
    linear: f64,
    force: Option<f64>,
    inertia: Option<f64>,
}

const BASE: &str = "[run]
seed = 1
name = \"base\"
[sac]
gamma = 0.95
batch_size = 256
hidden = [256, 256]
[policy]
name = \"P\"
linear = 0.02
force = 0.5
";

fn layer(name: &str, text: &str) -> Layer {
    Layer { name: name.into(), text: text.into() }
}

fn load(file: &str, set: &[&str]) -> Result<Config, ConfigError> {
    let set: Vec<String> = set.iter().map(|&s| s.into()).collect();
    parse(resolve(&layer("base", BASE), &[layer("my.toml", file)], &set, &["policy"])?)
}

fn message(file: &str, set: &[&str]) -> String {
    load(file, set).unwrap_err().to_string()
}

#[test]
fn arguments_win_over_files_and_files_over_the_base() {
    let config = load(
        "[sac]\ngamma = 0.9\nhidden = [64]\n[run]\nseed = 3",
        &["run.seed=4", "run.name=a_word", "sac.batch_size=1_000"],
    )
    .unwrap();
    assert_eq!(config.run, Run { seed: 4, name: "a_word".into() });
    assert_eq!(config.sac, Sac { gamma: 0.9, batch_size: 1000, hidden: vec![64] });
    assert_eq!(config.policy.force, Some(0.5));
}

#[test]
fn arguments_are_toml_values_or_words() {
    let config = load("", &["sac.hidden=[1, 2]", "sac.gamma=1", "run.name=\"two words\""]).unwrap();
    assert_eq!(config.sac.hidden, [1, 2]);
    assert_eq!(config.sac.gamma, 1.0);
    assert_eq!(config.run.name, "two words");
    assert_eq!(load("", &["run.name='a # b'"]).unwrap().run.name, "a # b");
    assert_eq!(load("", &["run.name=../robots/my.urdf"]).unwrap().run.name, "../robots/my.urdf");
    assert_eq!(load("", &["sac={gamma=0.5}"]).unwrap().sac.gamma, 0.5);
}

#[test]
fn an_unknown_key_names_the_nearest_one_and_the_line() {
    assert_eq!(
        message("# mine\n[sac]\ngamma = 0.9\nbatchsize = 8", &[]),
        "my.toml:4: there is no key `sac.batchsize`; did you mean `sac.batch_size`?"
    );
    assert_eq!(
        message("", &["sca.gamma=0.9"]),
        "--set sca.gamma=0.9: there is no key `sca`; did you mean `sac`?"
    );
    assert_eq!(
        message("\nbatch_size = 8", &[]),
        "my.toml:2: there is no key `batch_size`; did you mean `sac.batch_size`?"
    );
    assert_eq!(message("zzzzzzzzz = 1", &[]), "my.toml:1: there is no key `zzzzzzzzz`");
}

#[test]
fn a_value_that_does_not_fit_names_its_key_and_place() {
    let said = message("[run]\nseed = 1\n[sac]\ngamma = \"high\"", &[]);
    assert!(said.starts_with("my.toml:4: invalid type: string \"high\""), "{said}");
    assert!(said.ends_with("in `sac.gamma`"), "{said}");
    let said = message("", &["run.seed=-1"]);
    assert!(said.starts_with("--set run.seed=-1: ") && said.ends_with("in `run.seed`"), "{said}");
    let said = message("[run]\nseed = 1.5", &[]);
    assert!(said.starts_with("my.toml:2: ") && said.ends_with("in `run.seed`"), "{said}");
}

#[test]
fn broken_toml_shows_the_line_and_a_caret() {
    let said = message("[sac]\ngamma = = 3", &[]);
    assert!(said.starts_with("my.toml: TOML parse error at line 2, column 9"), "{said}");
    assert!(said.contains("2 | gamma = = 3\n  |         ^"), "{said}");
}

#[test]
fn arguments_that_are_no_assignment_are_refused() {
    for (argument, reason) in [
        ("sac.gamma", "expected key.path=value"),
        ("=3", "expected a key"),
        ("sac..gamma=3", "expected a key"),
        ("sac.gamma=", "no value"),
        ("sac.hidden=[1, ", "unclosed array"),
        ("run.name=two words", "must be quoted"),
        ("run.seed=1\nrun.name=\"x\"", "line break"),
    ] {
        let said = message("", &[argument]);
        assert!(said.starts_with(&format!("--set {argument}: ")), "{said}");
        assert!(said.contains(reason), "{argument}: {said}");
    }
}

#[test]
fn an_open_table_gains_optional_keys_that_serde_checks() {
    let config = load("[policy]\ninertia = 2.0", &["policy.linear=0.5"]).unwrap();
    let expected = Policy { name: "P".into(), linear: 0.5, force: Some(0.5), inertia: Some(2.0) };
    assert_eq!(config.policy, expected);
    let said = message("[policy]\n\ninertai = 2.0", &[]);
    assert!(said.starts_with("my.toml:3: unknown field `inertai`"), "{said}");
    assert!(said.ends_with("in `policy`"), "{said}");
}

#[test]
fn an_open_table_with_a_name_replaces_the_whole() {
    let config = load("[policy]\nname = \"A\"\nlinear = 0.1\ninertia = 2.0", &[]).unwrap();
    let expected = Policy { name: "A".into(), linear: 0.1, force: None, inertia: Some(2.0) };
    assert_eq!(config.policy, expected);
    assert!(message("[policy]\nname = \"A\"", &[]).contains("missing field `linear`"));
}

#[test]
fn nothing_is_nearest_to_nonsense() {
    let names = ["palpate", "paper"];
    assert_eq!(nearest("papr", names), Some("paper"));
    assert_eq!(nearest("palpat", names), Some("palpate"));
    assert_eq!(nearest("xyz", names), None);
}
