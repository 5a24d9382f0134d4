//! Recorded, read, refused, learned from.

use super::file::Demonstrations;
use super::*;
use crate::train;

fn choice(set: &[&str]) -> Choice {
    let (preset, task, model) = ("palpate".into(), "peg-insertion".into(), "P-14".into());
    let set = set.iter().map(ToString::to_string).collect();
    Choice { preset, task, model, file: None, set }
}

fn shown(set: &[&str], to: &Path) -> Account {
    let config = Config::load(&choice(set)).unwrap();
    let mut env = sim_env(&config, 5, Purpose::Demonstrate).unwrap();
    let mut script = Actor::scripted(&config, env.action_dim());
    let options = Options { episodes: 3, only_successes: true };
    record(&mut env, &mut script, &config, &options, to, |_, _| {}).unwrap()
}

#[test]
fn what_is_recorded_is_what_was_done_and_replaces_no_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("demo");
    let account = shown(&[], &path);
    assert_eq!((account.kept, account.successes), (3, 3));
    assert!(account.seconds > 1.0 && account.peak_force > 0.0, "{account:?}");
    let read = Demonstrations::read(&path).unwrap();
    let lessons = read.lessons();
    assert_eq!(lessons.len() as u64, account.steps);
    let ends: Vec<&Lesson> = lessons.iter().filter(|l| l.episode_end).collect();
    assert_eq!(ends.len(), 3);
    for end in ends {
        assert!(end.terminal);
        assert_eq!(end.summary.as_ref().unwrap().outcome, Outcome::Success);
    }
    for (now, next) in lessons.iter().zip(&lessons[1..]).filter(|(now, _)| !now.episode_end) {
        assert_eq!(now.next, next.observation);
    }
    let config = Config::load(&choice(&[])).unwrap();
    let before = std::fs::read(&path).unwrap();
    assert!(Writer::create(&path, "x", (18, 14), &config).is_err());
    assert_eq!(std::fs::read(&path).unwrap(), before);
}

#[test]
fn what_was_recorded_is_told_and_lucky_successes_are_called_so() {
    let dir = tempfile::tempdir().unwrap();
    let tell = |task: &str| {
        let session = Session {
            choice: Choice { task: task.into(), ..choice(&["run.seed=1"]) },
            by: "scripted".into(),
            options: Options { episodes: 2, only_successes: true },
            out: dir.path().join(task),
            propose: Some(dir.path().join(format!("{task}.toml"))),
        };
        let mut said = Vec::new();
        command(&session, &mut said).unwrap();
        Config::load(&Choice { file: session.propose, ..session.choice }).unwrap();
        String::from_utf8(said).unwrap()
    };
    let said = tell("peg-insertion");
    assert!(said.contains("2 episodes of peg-insertion, P-14, by scripted"), "{said}");
    assert!(said.contains("2 of 2 reached the goal, 2 kept"), "{said}");
    assert!(said.contains("cannot tell") && !said.contains("few starts"), "{said}");
    // The script inserts the sharp peg on one start in four.
    let said = tell("peg-insertion-sharp");
    assert!(said.contains("2 kept") && said.contains("few starts"), "{said}");
}

#[test]
fn other_settings_are_refused_by_key_and_harmless_ones_are_not() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("demo");
    shown(&[], &path);
    let read = Demonstrations::read(&path).unwrap();
    let fit = |set: &[&str]| read.fit(&Config::load(&choice(set)).unwrap(), (18, 14));
    fit(&["sim.friction=0.1", "task.distribution=fixed", "sac.gamma=0.9", "run.seed=9"]).unwrap();
    for (set, said) in [
        ("task.depth=0.015", "task.depth was 0.02 and is 0.015"),
        ("env.observation.position=40.0", "env.observation.position was 50.0"),
        ("reward.success=100.0", "reward.success was 200.0"),
        ("policy.motion.linear=0.03", "policy.motion.linear was 0.02"),
        ("safety.force_max=20.0", "safety.force_max was 25.0"),
        ("control.max_linear_speed=0.2", "control.max_linear_speed was 0.25"),
    ] {
        let error = format!("{:#}", fit(&[set]).unwrap_err());
        assert!(error.contains(said) && error.contains("Record it again"), "{error}");
    }
    let other = Choice { model: "P-24".into(), task: "ring-insertion".into(), ..choice(&[]) };
    let error = format!("{:#}", read.fit(&Config::load(&other).unwrap(), (18, 24)).unwrap_err());
    assert!(error.contains("task.name") && error.contains("policy.name"), "{error}");
    let config = Config::load(&choice(&[])).unwrap();
    let error = read.fit(&config, (18, 13)).unwrap_err().to_string();
    assert!(error.contains("14 actions, but this configuration 18 and 13"), "{error}");
}

#[test]
fn half_an_episode_is_left_out_and_damage_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("demo");
    let account = shown(&[], &path);
    let whole = std::fs::read(&path).unwrap();
    // A kill before the last record was written.
    std::fs::write(&path, &whole[..whole.len() - 1]).unwrap();
    let left = Demonstrations::read(&path).unwrap();
    assert_eq!(left.lessons().iter().filter(|l| l.episode_end).count(), 2);
    assert!((left.lessons().len() as u64) < account.steps - 1);
    assert!(left.lessons().last().unwrap().episode_end);
    let mut changed = whole.clone();
    changed[whole.len() / 2] ^= 1;
    std::fs::write(&path, changed).unwrap();
    let error = format!("{:#}", Demonstrations::read(&path).unwrap_err());
    assert!(error.contains("has changed on disk"), "{error}");
    std::fs::write(&path, "a, b\n1, 2\n").unwrap();
    let error = format!("{:#}", Demonstrations::read(&path).unwrap_err());
    assert!(error.contains("does not begin as a journal"), "{error}");
    let error = format!("{:#}", Demonstrations::read(&dir.path().join("none")).unwrap_err());
    assert!(error.contains("there is no file"), "{error}");
}

/// Gives up whenever it comes closer than this to the goal, m; a script otherwise.
struct Shy(Actor, f64);

impl Source for Shy {
    fn name(&self) -> String {
        "shy".into()
    }

    fn begin(&mut self, episode: u64) {
        self.0.begin(episode);
        // From the second episode on it dares.
        self.1 = if episode == 0 { self.1 } else { 0.0 };
    }

    fn act(&mut self, view: &View<'_>, action: &mut [f64]) -> ControlFlow<()> {
        if view.error.fixed_rows::<3>(0).norm() < self.1 {
            return ControlFlow::Break(());
        }
        Source::act(&mut self.0, view, action)
    }
}

#[test]
fn nothing_is_kept_of_an_episode_that_was_given_up() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("demo");
    let config = Config::load(&choice(&[])).unwrap();
    let mut env = sim_env(&config, 5, Purpose::Demonstrate).unwrap();
    let mut shy = Shy(Actor::scripted(&config, env.action_dim()), 0.01);
    let options = Options { episodes: 1, only_successes: true };
    let account = record(&mut env, &mut shy, &config, &options, &path, |_, _| {}).unwrap();
    assert_eq!((account.tried, account.kept, account.successes), (2, 1, 1));
    assert_eq!(Demonstrations::read(&path).unwrap().lessons().len() as u64, account.steps);
    // Who never comes to an end leaves no file.
    let path = dir.path().join("nothing");
    let mut never = Actor::zero(env.action_dim());
    let error = record(&mut env, &mut never, &config, &options, &path, |_, _| {}).unwrap_err();
    assert!(error.to_string().contains("none of 10 episodes reached the goal"), "{error}");
    assert!(!path.exists());
    let options = Options { only_successes: false, ..options };
    let account = record(&mut env, &mut never, &config, &options, &path, |_, _| {}).unwrap();
    assert_eq!((account.kept, account.successes), (1, 0));
}

#[test]
fn a_proposal_is_a_configuration_under_which_the_same_is_done_again() {
    let dir = tempfile::tempdir().unwrap();
    let account = shown(&[], &dir.path().join("demo"));
    let config = Config::load(&choice(&[])).unwrap();
    let text = account.observed.fragment(&config, "scripted").unwrap();
    assert!(text.contains("cannot tell"), "a script chooses no gains: {text}");
    let file = dir.path().join("proposed.toml");
    std::fs::write(&file, &text).unwrap();
    let proposed = Choice { file: Some(file.clone()), ..choice(&["safety.mode=\"shield\""]) };
    let proposed = Config::load(&proposed).unwrap();
    assert!(proposed.safety.force_max < config.safety.force_max, "{text}");
    assert!(proposed.safety.force_max >= 5.0 && proposed.policy == config.policy, "{text}");
    let (now, then) = (config.safety.shield.unwrap(), proposed.safety.shield.clone().unwrap());
    assert!(then.workspace.min >= now.workspace.min && then.workspace != now.workspace, "{text}");
    let mut env = sim_env(&proposed, 5, Purpose::Demonstrate).unwrap();
    let mut script = Actor::scripted(&proposed, env.action_dim());
    let again = evaluate::rollouts(&mut env, &mut script, 5, |_, _| {}).unwrap();
    let done = again.iter().filter(|s| s.outcome == Outcome::Success).count();
    assert!(done >= 4, "{done} of 5 under the proposal");

    // Whoever chooses gains is taken at their word; the goal stands there for who wants it.
    let options = Options { episodes: 1, only_successes: false };
    let mut env = sim_env(&proposed, 5, Purpose::Demonstrate).unwrap();
    let mut random = Actor::random(env.action_dim(), 1);
    let to = dir.path().join("random");
    let account = record(&mut env, &mut random, &proposed, &options, &to, |_, _| {}).unwrap();
    let text = account.observed.fragment(&proposed, "random").unwrap();
    let goal: Vec<&str> = text
        .lines()
        .skip_while(|line| !line.starts_with("# [task]"))
        .take_while(|line| line.starts_with("# "))
        .map(|line| line.trim_start_matches("# "))
        .collect();
    let whole = format!("{text}\n{}\n", goal.join("\n"));
    std::fs::write(&file, whole).unwrap();
    let chosen = Config::load(&Choice { file: Some(file), ..choice(&[]) }).unwrap();
    assert!(chosen.policy.gains != config.policy.gains, "{text}");
    assert!(chosen.task.hole_position != config.task.hole_position, "{text}");
    assert!(text.contains("[policy.gains.selection]"), "{text}");
    let (end, ..) = account.observed.end().unwrap();
    let goal = chosen.task.base_T_goal();
    assert!((goal.translation.vector - end.translation.vector).norm() < 2e-4, "{text}");
    assert!(goal.rotation.angle_to(&end.rotation) < 1e-3, "{text}");
}

#[test]
fn the_paper_preset_has_no_shield_and_takes_its_proposal_all_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let paper = Choice { preset: "paper".into(), ..choice(&[]) };
    let config = Config::load(&paper).unwrap();
    let mut env = sim_env(&config, 5, Purpose::Demonstrate).unwrap();
    let options = Options { episodes: 1, only_successes: false };
    let mut zero = Actor::zero(env.action_dim());
    let to = dir.path().join("demo");
    let account = record(&mut env, &mut zero, &config, &options, &to, |_, _| {}).unwrap();
    let file = dir.path().join("proposed.toml");
    std::fs::write(&file, account.observed.fragment(&config, "zero").unwrap()).unwrap();
    Config::load(&Choice { file: Some(file), ..paper }).unwrap();
}

/// Short episodes of a small learner.
const SMALL: [&str; 8] = [
    "env.max_steps=30",
    "sac.hidden=[8]",
    "sac.start_training=16",
    "sac.batch_size=16",
    "run.log_every=20",
    "run.evaluate_every=1000",
    "run.checkpoint_every=40",
    "record.collisions=0",
];

fn curve(run: &Path) -> String {
    std::fs::read_to_string(run.join("metrics.csv")).unwrap()
}

#[test]
fn a_run_keeps_what_it_was_shown_and_goes_on_from_it_as_if_undisturbed() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("demo");
    shown(&SMALL, &file);
    let run = |name: &str, steps: &str, from: bool| {
        let out = dir.path().join(name);
        let set = [&SMALL[..], &[steps, "run.seed=3"]].concat();
        if from {
            train::start_shown(&choice(&set), &file, Some(&out)).unwrap();
        } else {
            train::start(&choice(&set), Some(&out)).unwrap();
        }
        out
    };
    let straight = run("straight", "run.steps=120", true);
    let again = run("again", "run.steps=120", true);
    assert_eq!(curve(&straight), curve(&again), "the same seed gave another curve");
    let alone = run("alone", "run.steps=120", false);
    assert_ne!(curve(&straight), curve(&alone), "nothing was learned from demonstrations");

    let cut = run("cut", "run.steps=60", true);
    let begun = run("begun", "run.steps=60", true);
    std::fs::remove_file(&file).unwrap();
    train::resume(&cut, Some(120)).unwrap();
    assert_eq!(curve(&straight), curve(&cut), "resumed from a checkpoint");
    // Killed before its first checkpoint: the run holds a copy.
    std::fs::remove_dir_all(begun.join("checkpoints")).unwrap();
    train::resume(&begun, Some(120)).unwrap();
    assert_eq!(curve(&straight), curve(&begun), "begun anew");
    std::fs::remove_dir_all(begun.join("checkpoints")).unwrap();
    std::fs::remove_file(begun.join(palpate_runs::DEMONSTRATIONS)).unwrap();
    let error = train::resume(&begun, Some(160)).unwrap_err().to_string();
    assert!(error.contains("there are no demonstrations"), "{error}");
}

#[test]
fn a_share_of_nothing_and_no_share_of_something_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let (file, out) = (dir.path().join("demo"), dir.path().join("run"));
    shown(&SMALL, &file);
    let set = [&SMALL[..], &["sac.demonstration_share=0.5"]].concat();
    let error = train::start(&choice(&set), Some(&out)).unwrap_err().to_string();
    assert!(error.contains("there are no demonstrations"), "{error}");
    let set = [&SMALL[..], &["sac.demonstration_share=0.0"]].concat();
    let error = train::start_shown(&choice(&set), &file, Some(&out)).unwrap_err().to_string();
    assert!(error.contains("nothing would be learned"), "{error}");
    assert!(!out.exists(), "a run that did not begin left a folder");
    // A share that is stated wins over the default.
    let set = [&SMALL[..], &["sac.demonstration_share=0.25", "run.steps=30"]].concat();
    train::start_shown(&choice(&set), &file, Some(&out)).unwrap();
    let config = Config::of_run(&out, &[]).unwrap();
    assert_eq!(config.sac.demonstration_share, 0.25);
}

#[test]
fn collisions_are_remembered_where_danger_has_a_share() {
    let dir = tempfile::tempdir().unwrap();
    let run = |name: &str, steps: &str, more: &[&str]| {
        let out = dir.path().join(name);
        let set = [
            &SMALL[..],
            &["safety.mode=force-first", "safety.force_max=2.0", steps, "run.seed=3"],
            more,
        ]
        .concat();
        train::start(&choice(&set), Some(&out)).unwrap();
        out
    };
    let danger = ["sac.danger_share=0.25", "sac.danger_steps=5"];
    let without = run("without", "run.steps=120", &[]);
    let collided = palpate_runs::Csv::read(&without.join("metrics.csv")).unwrap();
    let collisions = collided.column("safety/collisions").unwrap();
    assert!(collisions.last().unwrap().unwrap() > 0.0, "nothing to remember");
    let straight = run("straight", "run.steps=120", &danger);
    assert_ne!(curve(&without), curve(&straight), "nothing was drawn from danger");
    let cut = run("cut", "run.steps=60", &danger);
    train::resume(&cut, Some(120)).unwrap();
    assert_eq!(curve(&straight), curve(&cut));
}
