//! The page.

use std::fmt::Write as _;

use super::behaviour::{Behaviour, EPISODES, Phase};
use super::charts::{self, Picture};
use super::origin::origin;
use super::run::Run;
use crate::plot::Group;

pub(crate) const STYLE: &str = include_str!("style.css");

/// Text as HTML.
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Pictures side by side; says so if there is none yet.
fn figures(pictures: impl IntoIterator<Item = (Picture, &'static str)>) -> String {
    let one = |(svg, caption): (String, &str)| {
        let caption = if caption.is_empty() {
            String::new()
        } else {
            format!("<figcaption>{caption}</figcaption>")
        };
        format!("<figure>{}{caption}</figure>", scaled(&svg))
    };
    let drawn: Vec<String> =
        pictures.into_iter().filter_map(|(p, caption)| Some(one((p?, caption)))).collect();
    if drawn.is_empty() {
        return "<p class=none>Nothing to draw yet.</p>".into();
    }
    format!("<div class=figures>{}</div>", drawn.join(""))
}

/// An SVG that is as wide as its place: it has a viewBox instead of a size.
pub(crate) fn scaled(svg: &str) -> String {
    let Some((head, rest)) = svg.split_once('>') else { return svg.into() };
    let attribute = |name: &str| {
        let (_, rest) = head.split_once(&format!(" {name}=\""))?;
        rest.split_once('"').map(|(value, _)| value.to_owned())
    };
    match (attribute("width"), attribute("height")) {
        (Some(w), Some(h)) => {
            let size = format!("viewBox=\"0 0 {w} {h}\" role=\"img\"");
            format!("<svg xmlns=\"http://www.w3.org/2000/svg\" {size}>{rest}")
        }
        _ => svg.into(),
    }
}

pub(crate) fn table(head: &[&str], rows: &[Vec<String>]) -> String {
    let cells = |tag: &str, cells: &mut dyn Iterator<Item = String>| {
        cells.map(|cell| format!("<{tag}>{cell}</{tag}>")).collect::<Vec<_>>().concat()
    };
    let mut out = format!(
        "<div class=wide><table><tr>{}</tr>",
        cells("th", &mut head.iter().map(|h| (*h).to_owned()))
    );
    for row in rows {
        _ = write!(out, "<tr>{}</tr>", cells("td", &mut row.iter().cloned()));
    }
    out + "</table></div>"
}

fn or_dash(x: Option<f64>, digits: usize) -> String {
    x.map_or_else(|| "–".into(), |x| format!("{x:.digits$}"))
}

/// The whole page.
pub(super) fn page(runs: &[Run], groups: &[Group]) -> anyhow::Result<String> {
    let title = match runs {
        [run] => run.name.clone(),
        runs => format!("{} runs", runs.len()),
    };
    let mut body = format!("<header><h1>{}</h1>", escape(&title));
    _ = write!(
        body,
        "<p>A report of palpate {}, from the runs' own files.</p></header>",
        env!("CARGO_PKG_VERSION")
    );
    body += &section("At a glance", &glance(runs));
    body += &section("Learning", &learning(runs, groups));
    body += &section("Force and the fail-safe layer", &safety(runs, groups));
    for run in runs {
        let name = if runs.len() > 1 { format!(": {}", escape(&run.name)) } else { String::new() };
        body += &section(&format!("The policy before and after{name}"), &change(run));
    }
    body += &section("The learner", &learner(runs, groups));
    body += &section("Configuration and provenance", &origin(runs)?);
    Ok(format!(
        "<!DOCTYPE html>\n<html lang=en><head><meta charset=utf-8>\
         <meta name=viewport content=\"width=device-width, initial-scale=1\">\
         <title>{} · palpate</title><style>{STYLE}</style></head><body><main>{body}</main></body></html>\n",
        escape(&title)
    ))
}

fn section(title: &str, body: &str) -> String {
    format!("<section><h2>{title}</h2>{body}</section>")
}

fn glance(runs: &[Run]) -> String {
    let row = |run: &Run| {
        let success = run.success().map_or_else(
            || "–".into(),
            |(rate, (low, high))| {
                format!("<b>{:.0} %</b> ({:.0}–{:.0})", 100.0 * rate, 100.0 * low, 100.0 * high)
            },
        );
        let steps = run.steps();
        let collisions = run.sum("collision");
        let per_1000 = 1e3 * collisions / steps.max(1) as f64;
        let state = run.state();
        vec![
            format!("<b>{}</b>", escape(&run.name)),
            format!(
                "{}, {}, seed {}",
                escape(&run.config.task.name),
                escape(&run.config.policy.name),
                run.config.run.seed
            ),
            format!("<span class={state}>{state}</span> {steps} / {}", run.config.run.steps),
            format!("{:.0}", run.sum("success"))
                + &format!(" / {}", run.episodes.as_ref().map_or(0, palpate_runs::Csv::rows)),
            success,
            format!("{collisions:.0} ({per_1000:.1})"),
            or_dash(run.last("eval/peak_force"), 1)
                + &format!(" / {}", run.config.safety.force_max),
        ]
    };
    let head = [
        "run",
        "what",
        "steps",
        "successful episodes in training",
        "success, latest evaluation (95 %)",
        "collisions (per 1,000 steps)",
        "peak force, median / limit, N",
    ];
    table(&head, &runs.iter().map(row).collect::<Vec<_>>())
}

fn learning(runs: &[Run], groups: &[Group]) -> String {
    let rate = Some((0.0, 1.0));
    let draw = |what, range| charts::learning(runs, groups, what, range);
    figures([
        (
            draw(
                (
                    "eval/success_rate",
                    "Success of the deterministic policy",
                    "share of the frozen starts",
                ),
                rate,
            ),
            "",
        ),
        (
            draw(
                ("rollout/success_rate", "Success while training", "share of the last 20 episodes"),
                rate,
            ),
            "",
        ),
        (
            draw(
                ("rollout/ep_rew_mean", "Return while training", "mean of the last 20 episodes"),
                None,
            ),
            "",
        ),
        (
            draw(
                ("rollout/ep_len_mean", "Length of an episode", "actions, mean of the last 20"),
                None,
            ),
            "",
        ),
    ])
}

fn safety(runs: &[Run], groups: &[Group]) -> String {
    let collisions =
        charts::learning(runs, groups, ("safety/collisions", "Collisions", "so far"), None);
    let mut out = figures([
        (
            charts::peaks(runs),
            "The norm of the unfiltered force; the limit is one axis' of the filtered force.",
        ),
        (collisions, ""),
    ]);
    for run in runs {
        let name = escape(&run.name);
        let Some(ledger) = &run.ledger else {
            _ = write!(out, "<p class=none>{name} kept no ledger.</p>");
            continue;
        };
        if ledger.causes.is_empty() {
            _ = write!(out, "<p>{name}: the fail-safe layer let every command pass.</p>");
            continue;
        }
        let row = |r: &crate::ledger::Row| {
            let (early, late) = r.early_and_late;
            vec![
                escape(&r.cause),
                r.events.to_string(),
                format!("{:.2}", r.per_episode),
                format!("{:.1}", r.per_1000_steps),
                format!("{early:.1} → {late:.1}"),
                format!("{:.1}", r.largest_force),
            ]
        };
        let head = [
            "cause",
            "times",
            "per episode",
            "per 1,000 steps",
            "in the first → last tenth",
            "largest force, N",
        ];
        _ = write!(out, "<h3>{name}: by cause and place</h3><div class=beside>");
        out += &table(&head, &ledger.causes.iter().map(row).collect::<Vec<_>>());
        out += &figures([(charts::places(run), "")]);
        out += "</div>";
    }
    out
}

fn change(run: &Run) -> String {
    let limit = run.config.safety.force_max;
    let mut columns = String::new();
    let behaviours =
        [("A fresh policy with this seed", &run.before), ("The last policy", &run.after)];
    let highest = |of: fn(&super::behaviour::Trace) -> &Vec<(f64, f64)>| {
        let all = behaviours.iter().filter_map(|(_, b)| b.as_ref()).flat_map(|b| &b.traces);
        all.flat_map(of).map(|(_, y)| *y).fold(0.0, f64::max)
    };
    let (top, height, offset) =
        (highest(|t| &t.force).max(1.1 * limit), highest(|t| &t.height), highest(|t| &t.offset));
    let depth = 1e3 * run.config.task.depth;
    for (title, behaviour) in behaviours {
        let Some(b) = behaviour else {
            _ = write!(columns, "<div><h3>{title}</h3><p class=none>No checkpoint yet.</p></div>");
            continue;
        };
        let line = Some((limit, "limit of one axis".to_owned()));
        let goal = Some((-depth, "goal".to_owned()));
        let pictures = figures([
            (charts::traces(b, ("Contact force", "N"), |t| &t.force, Some((0.0, top)), line), ""),
            (
                charts::traces(
                    b,
                    ("Height above the mouth", "mm"),
                    |t| &t.height,
                    Some((-depth - 2.0, height)),
                    goal,
                ),
                "",
            ),
            (
                charts::traces(
                    b,
                    ("Distance from the hole's axis", "mm"),
                    |t| &t.offset,
                    Some((0.0, offset)),
                    None,
                ),
                "",
            ),
        ]);
        let peak = b.summaries.iter().map(|s| s.peak_force).fold(0.0, f64::max);
        let seconds: f64 =
            b.summaries.iter().map(|s| s.seconds).sum::<f64>() / b.summaries.len().max(1) as f64;
        _ = write!(
            columns,
            "<div><h3>{title}</h3><p>{} of {EPISODES} starts succeed, {seconds:.2} s per episode, largest peak {peak:.1} N</p>{pictures}</div>",
            b.successes()
        );
    }
    let how = if run.config.ur.is_some() {
        "Both run here in simulation, with the mean action on the same frozen starts; the run itself was made on an arm."
    } else {
        "Both with the mean action on the same frozen starts, in simulation."
    };
    format!("<p>{how}</p><div class=pair>{columns}</div><h3>Gains by phase</h3>{}", gains(run))
}

/// Mean gains by phase, before and after.
fn gains(run: &Run) -> String {
    let Some(before) = &run.before else { return String::new() };
    let empty = Vec::new();
    let after = run.after.as_ref().map_or(&empty, |b: &Behaviour| &b.gains);
    let mut head = vec!["gain".to_owned()];
    for phase in Phase::ALL {
        head.push(format!("{}: before", phase.name()));
        head.push("after".to_owned());
    }
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let row = |(i, (name, means)): (usize, &(String, [Option<f64>; 3]))| {
        let mut cells = vec![escape(name)];
        let later = after.get(i).map_or([None; 3], |(_, means)| *means);
        let most = means.iter().chain(&later).flatten().fold(0.0f64, |a, b| a.max(b.abs()));
        for (b, a) in means.iter().zip(later) {
            for (value, class) in [(*b, "before"), (a, "after")] {
                let share = value.filter(|_| most > 0.0).map_or(0.0, |v| 100.0 * v.abs() / most);
                let text = value.map_or_else(|| "–".into(), significant);
                cells.push(format!(
                    "<span class=\"bar {class}\" style=\"--share:{share:.0}%\">{text}</span>"
                ));
            }
        }
        cells
    };
    table(&head, &before.gains.iter().enumerate().map(row).collect::<Vec<_>>())
}

/// Three digits that matter.
fn significant(x: f64) -> String {
    let digits = if x == 0.0 { 0 } else { (2 - x.abs().log10().floor() as i32).clamp(0, 6) };
    format!("{x:.*}", digits as usize)
}

fn learner(runs: &[Run], groups: &[Group]) -> String {
    let draw = |column, title, label| charts::learning(runs, groups, (column, title, label), None);
    figures([
        (
            draw(
                "eval/q_minus_return",
                "Q minus the return that followed",
                "scaled reward, at the start",
            ),
            "Far above zero: the critic believes what does not happen.",
        ),
        (draw("train/critic_loss", "Critic loss", "scaled reward²"), ""),
        (draw("train/entropy", "Entropy of the policy", "nats"), ""),
        (draw("train/ent_coef", "Entropy's weight α", ""), ""),
    ])
}
