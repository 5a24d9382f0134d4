//! The page of small runs, made here.

use super::*;
use crate::config::Choice;
use crate::train;

fn trained(dir: &Path, name: &str, seed: u64) -> PathBuf {
    let out = dir.join(name);
    let set = [
        &format!("run.seed={seed}"),
        "run.steps=120",
        "run.log_every=40",
        "run.evaluate_every=60",
        "run.evaluate_episodes=1",
        "run.checkpoint_every=60",
        "env.max_steps=30",
        "safety.mode=force-first",
        "safety.force_max=6.0",
        "sac.hidden=[8]",
        "sac.start_training=16",
        "sac.batch_size=16",
    ];
    let set = set.iter().map(ToString::to_string).collect();
    let (preset, task, model) = ("palpate".into(), "peg-insertion".into(), "P-14".into());
    train::start(&Choice { preset, task, model, file: None, set }, Some(&out)).unwrap();
    out
}

#[test]
fn the_page_tells_of_every_run_and_needs_no_network() {
    let dir = tempfile::tempdir().unwrap();
    let runs = vec![trained(dir.path(), "first <run>", 1), trained(dir.path(), "second", 2)];
    // What a training leaves to be looked at.
    let recordings = std::fs::read_dir(runs[0].join(crate::record::FOLDER)).unwrap().count();
    assert!(recordings > 0);

    let before = version(&runs);
    let page = render(&runs).unwrap();
    for said in [
        "first &lt;run&gt;",
        "second",
        "Success of the deterministic policy",
        "Peak force of every episode",
        "limit of one axis",
        "Gains by phase",
        "A fresh policy with this seed",
        "The last policy",
        "What differs",
        "run.seed",
        "palpate ",
    ] {
        assert!(page.contains(said), "{said} is not on the page");
    }
    assert!(page.contains("P-14, peg-insertion (2 runs)"), "seeds are not drawn together");
    // Nothing is fetched: the only addresses are the names of XML's namespaces.
    for address in page.split("http").skip(1) {
        assert!(address.starts_with("://www.w3.org/"), "{}", &address[..40.min(address.len())]);
    }
    for loading in ["<script", "<link", "<img", "<iframe", "@import"] {
        assert!(!page.contains(loading), "{loading}");
    }
    // A clip path within the page is no address.
    assert!(page.split("url(").skip(1).all(|at| at.starts_with(['#', '"'])), "something is loaded");
    assert_eq!(page.matches("<svg").count(), page.matches("</svg>").count());
    assert_eq!(version(&runs), before);
    std::fs::write(runs[0].join("summary.json"), "{}").unwrap();
    assert_ne!(version(&runs), before);
}

#[test]
fn a_folder_that_is_no_run_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let error = format!("{:#}", render(&[dir.path().to_owned()]).unwrap_err());
    assert!(error.contains("is not a run"), "{error}");
}
