//! Which settings make sense.

use crate::SimError;
use crate::config::{ComplianceConfig, PegShape, SimConfig};

/// Largest ratio of joint impulse to inertia that one Gauss-Seidel pass is trusted with: false forces set in at twice
/// that.
///
/// Measured: see "How stiff" in `docs/results/contact.md`.
const RATIO_PER_PASS: f64 = 0.5;
/// Contact stiffness over m·ω² of a flat face, from the deflection of a press at 500, 1000 and 2000 Hz.
const FACE_STIFFNESS: f64 = 4.6;
/// Part of a press that may be the contact's own give.
const CONTACT_SHARE: f64 = 0.02;
/// Smallest clearance worth simulating, m.
const CLEARANCE_MIN: f64 = 1e-5;
/// Time per tick, s.
const TICK: f64 = 0.002;
/// World steps per tick that are worth suggesting.
const STEPS_MAX: u32 = 64;

/// A body on a spring.
struct Sprung<'a> {
    key: &'static str,
    compliance: &'a ComplianceConfig,
    /// Spring to centre of mass, m.
    lever: f64,
    /// About that centre, across the spring's axis, kg·m².
    inertia: f64,
}

impl SimConfig {
    /// Checks every number.
    ///
    /// # Errors
    /// The first that makes no sense, with what would.
    pub fn validate(&self) -> Result<(), SimError> {
        self.check_values()?;
        self.check_spread(Self::check_values)
    }

    fn check_values(&self) -> Result<(), SimError> {
        self.check_signs()?;
        self.check_receptacle()?;
        self.check_geometry()?;
        self.check_obstacles()?;
        self.check_stiffness()
    }

    fn check_signs(&self) -> Result<(), SimError> {
        let (c, s, w) = (&self.compliance, &self.solver, &self.sensor);
        let positive = [
            ("peg.width", self.peg.width),
            ("peg.length", self.peg.length),
            ("hole.depth", self.hole.depth),
            ("hole.board_half_width", self.hole.board_half_width),
            ("tool.mass", self.tool.mass),
            ("tool.length", self.tool.length),
            ("tool.half_width", self.tool.half_width),
            ("tool.inertia[0]", self.tool.inertia[0]),
            ("tool.inertia[1]", self.tool.inertia[1]),
            ("tool.inertia[2]", self.tool.inertia[2]),
            ("compliance.linear_stiffness", c.linear_stiffness),
            ("compliance.angular_stiffness", c.angular_stiffness),
            ("compliance.linear_damping", c.linear_damping),
            ("compliance.angular_damping", c.angular_damping),
            ("solver.contact_frequency", s.contact_frequency),
            ("solver.contact_damping_ratio", s.contact_damping_ratio),
            ("solver.prediction_distance", s.prediction_distance),
        ];
        require(&positive, |x| x > 0.0, "positive and finite")?;
        let not_negative = [
            ("friction", self.friction),
            ("hole.chamfer", self.hole.chamfer),
            ("peg.chamfer", self.peg.chamfer),
            ("tool.centre_of_mass", self.tool.centre_of_mass),
            ("servo.lag", self.servo.lag),
            ("servo.dead_time", self.servo.dead_time),
            ("sensor.force_noise", w.force_noise),
            ("sensor.torque_noise", w.torque_noise),
            ("sensor.force_bias", w.force_bias),
            ("sensor.torque_bias", w.torque_bias),
            ("sensor.force_drift", w.force_drift),
            ("sensor.torque_drift", w.torque_drift),
            ("sensor.force_quantum", w.force_quantum),
            ("sensor.torque_quantum", w.torque_quantum),
        ];
        require(&not_negative, |x| x >= 0.0, "finite and not negative")?;
        let counts = [
            ("solver.steps_per_tick", f64::from(s.steps_per_tick)),
            ("solver.iterations", s.iterations as f64),
            ("solver.pgs_iterations", s.pgs_iterations as f64),
        ];
        require(&counts, |x| x >= 1.0, "at least 1")
    }

    fn check_receptacle(&self) -> Result<(), SimError> {
        let Some(r) = &self.receptacle else { return Ok(()) };
        let c = &r.compliance;
        let positive = [
            ("receptacle.mass", r.mass),
            ("receptacle.inertia[0]", r.inertia[0]),
            ("receptacle.inertia[1]", r.inertia[1]),
            ("receptacle.inertia[2]", r.inertia[2]),
            ("receptacle.compliance.linear_stiffness", c.linear_stiffness),
            ("receptacle.compliance.angular_stiffness", c.angular_stiffness),
            ("receptacle.compliance.linear_damping", c.linear_damping),
            ("receptacle.compliance.angular_damping", c.angular_damping),
        ];
        require(&positive, |x| x > 0.0, "positive and finite")
    }

    fn check_geometry(&self) -> Result<(), SimError> {
        let per_side = self.hole.clearance / 2.0;
        at_least("hole.clearance", self.hole.clearance, CLEARANCE_MIN, || {
            "contacts give way by micrometres".into()
        })?;
        at_most(
            "solver.prediction_distance",
            self.solver.prediction_distance,
            per_side / 2.0,
            || "half the clearance per side, or the mouth blocks the peg".into(),
        )?;
        at_most("hole.chamfer", self.hole.chamfer, self.hole.depth / 2.0, || {
            "half the board's thickness".into()
        })?;
        let most = if self.peg.shape == PegShape::Round { self.peg.width / 4.0 } else { 0.0 };
        at_most("peg.chamfer", self.peg.chamfer, most, || {
            "a quarter of a round peg's width, nothing on a prism".into()
        })?;
        at_most("peg.chamfer", self.peg.chamfer, self.peg.length / 2.0, || {
            "half the peg's length".into()
        })?;
        let held = if self.ring_on_tool() { "hole.depth" } else { "peg.length" };
        at_most(held, self.held_length(), self.tool.length, || "sim.tool.length".into())?;
        at_most("servo.dead_time", self.servo.dead_time, 1.0, || "a second".into())?;
        if self.ring_on_tool() {
            if self.peg.shape != PegShape::Round {
                let (key, value) = ("peg.width", self.peg.width);
                let must =
                    "of a round peg: the tool can hold a ring over a bolt, no other hole".into();
                return Err(SimError::Setting { key, value, must });
            }
            return at_least(
                "hole.board_half_width",
                self.hole.board_half_width,
                self.mouth_half_width() * 1.1,
                || "the ring's outer radius, a tenth more than its mouth".into(),
            );
        }
        let room = self.mouth_half_width() + 2.0 * self.peg.width;
        at_least("hole.board_half_width", self.hole.board_half_width, room, || {
            "so that a peg beside the hole lands on the board".into()
        })
    }

    fn check_obstacles(&self) -> Result<(), SimError> {
        for obstacle in &self.obstacles {
            require(
                &obstacle.half.map(|x| ("obstacles.half", x)),
                |x| x > 0.0,
                "positive and finite",
            )?;
            require(&obstacle.centre.map(|x| ("obstacles.centre", x)), |_| true, "finite")?;
        }
        Ok(())
    }

    fn check_stiffness(&self) -> Result<(), SimError> {
        let tool = Sprung {
            key: "compliance.linear_stiffness",
            compliance: &self.compliance,
            lever: self.tool.centre_of_mass,
            inertia: self.tool.inertia[0].min(self.tool.inertia[1]),
        };
        self.check_spring(&tool)?;
        if let Some(r) = &self.receptacle {
            let key = "receptacle.compliance.linear_stiffness";
            let lever = self.receptacle_lever();
            let inertia = r.inertia[0].min(r.inertia[1]);
            self.check_spring(&Sprung { key, compliance: &r.compliance, lever, inertia })?;
        }
        let face = FACE_STIFFNESS * self.tool.mass * CONTACT_SHARE;
        let slowest = (self.compliance.linear_stiffness / face).sqrt() / std::f64::consts::TAU;
        at_least("solver.contact_frequency", self.solver.contact_frequency, slowest, || {
            format!(
                "or contacts give way by more than {:.0} % of the sensor's spring",
                CONTACT_SHARE * 100.0
            )
        })
    }

    /// Distance from the receptacle's spring to its centre of mass, m.
    pub(crate) fn receptacle_lever(&self) -> f64 {
        0.5 * if self.ring_on_tool() { self.peg.length } else { self.hole.depth }
    }

    fn check_spring(&self, spring: &Sprung<'_>) -> Result<(), SimError> {
        let steps = self.solver.steps_per_tick;
        if self.settles(spring, 1.0, steps) {
            return Ok(());
        }
        let most = self.stiffest_that_settles(spring);
        let enough = (steps..=STEPS_MAX).find(|n| self.settles(spring, 1.0, *n));
        let or =
            enough.map_or(String::new(), |n| format!(", or solver.steps_per_tick at least {n}"));
        let c = spring.compliance;
        Err(SimError::Setting {
            key: spring.key,
            value: c.linear_stiffness,
            must: format!(
                "at most {:.2e} N/m for this body and solver, with angular_stiffness at most {:.2e} N·m/rad \
                 and the dampings at most {:.2e} N·s/m and {:.2e} N·m·s/rad{or}",
                c.linear_stiffness * most,
                c.angular_stiffness * most,
                c.linear_damping * most.sqrt(),
                c.angular_damping * most.sqrt(),
            ),
        })
    }

    /// Whether the passes settle springs of `scale` times the stiffness, at the same damping ratio.
    ///
    /// The hard axis is a rotation across the tool: its spring acts at the sensor, a lever away from the
    /// centre of mass, so that force and torque rows fight over it. In one substep h the springs change its
    /// speed by (h·c + h²·k)/J of itself.
    fn settles(&self, spring: &Sprung<'_>, scale: f64, steps: u32) -> bool {
        let c = spring.compliance;
        let lever = spring.lever.powi(2);
        let stiffness = scale * (c.angular_stiffness + c.linear_stiffness * lever);
        let damping = scale.sqrt() * (c.angular_damping + c.linear_damping * lever);
        let h = TICK / (f64::from(steps) * self.solver.iterations as f64);
        (h * damping + h * h * stiffness) / spring.inertia
            <= RATIO_PER_PASS * self.solver.pgs_iterations as f64
    }

    /// Largest factor on the stiffness that settles, by bisection.
    fn stiffest_that_settles(&self, spring: &Sprung<'_>) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let middle = f64::midpoint(low, high);
            if self.settles(spring, middle, self.solver.steps_per_tick) {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }
}

fn require(
    values: &[(&'static str, f64)],
    holds: impl Fn(f64) -> bool,
    must: &str,
) -> Result<(), SimError> {
    match values.iter().find(|(_, value)| !(holds(*value) && value.is_finite())) {
        Some((key, value)) => Err(SimError::Setting { key, value: *value, must: must.into() }),
        None => Ok(()),
    }
}

fn at_most(
    key: &'static str,
    value: f64,
    most: f64,
    why: impl Fn() -> String,
) -> Result<(), SimError> {
    if value <= most {
        return Ok(());
    }
    Err(SimError::Setting { key, value, must: format!("at most {most:.3e}: {}", why()) })
}

fn at_least(
    key: &'static str,
    value: f64,
    least: f64,
    why: impl Fn() -> String,
) -> Result<(), SimError> {
    if value >= least {
        return Ok(());
    }
    Err(SimError::Setting { key, value, must: format!("at least {least:.3e}: {}", why()) })
}
