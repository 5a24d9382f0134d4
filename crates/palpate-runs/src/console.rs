//! What a person sees of a run: one live line on a terminal, a plain line now and then elsewhere.
//!
//! Everything goes to standard output, so that `> log` and `| tee log` keep it all.

use std::collections::VecDeque;
use std::fmt;
use std::io::{IsTerminal as _, Write};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Between two states of the live line.
const LIVE: Duration = Duration::from_millis(100);
/// Between two plain lines.
const PLAIN: Duration = Duration::from_secs(5);
/// Time that the rate is taken over: long enough for the evaluations in it to average out.
const WINDOW: Duration = Duration::from_mins(1);

/// Shows the progress of a run.
pub struct Console {
    target: Target,
    total: u64,
    rate: Rate,
    /// When the line was last shown.
    shown: Option<Instant>,
    /// The newest state, shown or not.
    now: Instant,
    step: u64,
    line: String,
}

enum Target {
    Live(ProgressBar),
    Plain(Box<dyn Write + Send>),
}

impl fmt::Debug for Console {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Console")
            .field("total", &self.total)
            .field("line", &self.line)
            .finish_non_exhaustive()
    }
}

impl Console {
    /// A run of `total` steps that has taken `at` of them.
    pub fn new(total: u64, at: u64) -> Self {
        let out = std::io::stdout();
        if !out.is_terminal() {
            return Self::plain(Box::new(out), total, at);
        }
        // The rate is ours: this bar only keeps the line in place.
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stdout());
        if let Ok(style) = ProgressStyle::with_template("{wide_msg}") {
            bar.set_style(style);
        }
        Self::with(Target::Live(bar), total, at)
    }

    fn plain(out: Box<dyn Write + Send>, total: u64, at: u64) -> Self {
        Self::with(Target::Plain(out), total, at)
    }

    fn with(target: Target, total: u64, at: u64) -> Self {
        let now = Instant::now();
        let rate = Rate::new(now, at);
        Self { target, total, rate, shown: None, now, step: at, line: String::new() }
    }

    /// Shows the state at `step`, with steps per second and the time left; most calls return at once.
    pub fn update(&mut self, step: u64, line: &str) {
        self.update_at(Instant::now(), step, line);
    }

    fn update_at(&mut self, now: Instant, step: u64, line: &str) {
        // Kept even if it is not shown: it may be the last.
        (self.now, self.step) = (now, step);
        self.line.clear();
        self.line.push_str(line);
        let pause = if matches!(self.target, Target::Live(_)) { LIVE } else { PLAIN };
        if self.shown.is_none_or(|shown| now.duration_since(shown) >= pause) {
            self.shown = Some(now);
            self.show();
        }
    }

    fn show(&mut self) {
        self.rate.add(self.now, self.step);
        let line =
            format!("{}/{} {}{}", self.step, self.total, self.line, self.rate.text(self.total));
        match &mut self.target {
            Target::Live(bar) => bar.set_message(line),
            Target::Plain(out) => print(out, &line),
        }
    }

    /// Prints something that stays.
    pub fn note(&mut self, text: &str) {
        match &mut self.target {
            Target::Live(bar) => bar.suspend(|| print(&mut std::io::stdout(), text)),
            Target::Plain(out) => print(out, text),
        }
    }

    /// Prints a box of names and values, as Stable-Baselines3 does.
    pub fn table(&mut self, rows: &[(&str, String)]) {
        self.note(&boxed(rows));
    }

    /// Ends the live line; its last state stays. What follows is plain.
    pub fn finish(&mut self) {
        if let Target::Live(bar) = &self.target {
            bar.finish_and_clear();
            self.target = Target::Plain(Box::new(std::io::stdout()));
        }
        if self.shown.is_some() {
            self.show();
        }
    }
}

/// A reader that has gone is no reason to stop a run.
fn print(out: &mut dyn Write, text: &str) {
    let _ = writeln!(out, "{text}").and_then(|()| out.flush());
}

fn boxed(rows: &[(&str, String)]) -> String {
    let width = |lengths: &mut dyn Iterator<Item = usize>| lengths.max().unwrap_or(0);
    let names = width(&mut rows.iter().map(|(name, _)| name.chars().count()));
    let values = width(&mut rows.iter().map(|(_, value)| value.chars().count()));
    let edge = "-".repeat(names + values + 7);
    let lines = rows.iter().map(|(name, value)| format!("| {name:<names$} | {value:<values$} |\n"));
    format!("{edge}\n{}{edge}", lines.collect::<String>())
}

/// Steps per second over the last [`WINDOW`].
struct Rate {
    samples: VecDeque<(Instant, u64)>,
}

impl Rate {
    fn new(now: Instant, step: u64) -> Self {
        Self { samples: VecDeque::from([(now, step)]) }
    }

    fn add(&mut self, now: Instant, step: u64) {
        self.samples.push_back((now, step));
        // One sample at or beyond the window stays.
        while self.samples.get(1).is_some_and(|(t, _)| now.duration_since(*t) >= WINDOW) {
            self.samples.pop_front();
        }
    }

    fn per_second(&self) -> Option<f64> {
        let ((t0, s0), (t1, s1)) = (self.samples.front()?, self.samples.back()?);
        let seconds = t1.duration_since(*t0).as_secs_f64();
        (seconds > 0.0 && s1 > s0).then(|| (s1 - s0) as f64 / seconds)
    }

    fn text(&self, total: u64) -> String {
        let Some(rate) = self.per_second() else { return String::new() };
        let step = self.samples.back().map_or(0, |(_, step)| *step);
        let left = (total.saturating_sub(step) as f64 / rate).round() as u64;
        let eta = format!("{}:{:02}:{:02}", left / 3600, left / 60 % 60, left % 60);
        format!("  {rate:.0} steps/s  ETA {eta}")
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;

    #[derive(Clone, Default)]
    struct Screen(Arc<Mutex<Vec<u8>>>);

    impl Write for Screen {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0.lock().unwrap().write(bytes)
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    impl Screen {
        fn lines(&self) -> Vec<String> {
            String::from_utf8(self.0.lock().unwrap().clone())
                .unwrap()
                .lines()
                .map(str::to_owned)
                .collect()
        }
    }

    #[test]
    fn plain_lines_come_every_few_seconds_and_the_last_state_at_the_end() {
        let screen = Screen::default();
        let mut console = Console::plain(Box::new(screen.clone()), 1200, 100);
        let start = console.rate.samples[0].0;
        for step in 101..=1100 {
            // 50 steps per second: 20 s.
            let now = start + Duration::from_millis(20 * (step - 100));
            console.update_at(now, step, &format!("return {step}"));
        }
        console.finish();
        console.note("done");
        let lines = screen.lines();
        assert_eq!(lines.len(), 6, "{lines:?}");
        assert_eq!(lines[0], "101/1200 return 101  50 steps/s  ETA 0:00:22");
        assert_eq!(lines[1], "351/1200 return 351  50 steps/s  ETA 0:00:17");
        assert_eq!(lines[4], "1100/1200 return 1100  50 steps/s  ETA 0:00:02");
        assert_eq!(lines[5], "done");
    }

    #[test]
    fn the_rate_forgets_what_is_long_ago() {
        let start = Instant::now();
        let mut rate = Rate::new(start, 0);
        let mut step = 0;
        for second in 1..=300 {
            step += if second <= 100 { 1000 } else { 10 };
            rate.add(start + Duration::from_secs(second), step);
        }
        assert_eq!(rate.per_second(), Some(10.0));
        assert_eq!(rate.text(step + 36_610), "  10 steps/s  ETA 1:01:01");
        assert!(rate.samples.len() < 70);
    }

    #[test]
    fn a_table_is_a_box() {
        let rows = [("eval/success_rate", "0.95".to_owned()), ("step", "2000 µ".to_owned())];
        let expected = "\
------------------------------
| eval/success_rate | 0.95   |
| step              | 2000 µ |
------------------------------";
        assert_eq!(boxed(&rows), expected);
    }
}
