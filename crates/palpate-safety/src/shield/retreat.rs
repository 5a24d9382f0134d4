//! After a force stop: a little way out along the contact force, until it is gone.

use palpate_spatial::Vector3;

use super::config::RetreatConfig;

/// The force may still grow this much while the servo catches up with the stop.
const GROWTH: f64 = 1.3;

/// The retreat under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Retreat {
    config: RetreatConfig,
    moved: f64,
    time: f64,
    /// Force at the start, N.
    start: Option<f64>,
}

impl Retreat {
    /// A retreat that has not begun.
    pub fn new(config: RetreatConfig) -> Self {
        Self { config, moved: 0.0, time: 0.0, start: None }
    }

    /// Velocity for the next `dt` (s) given the force on the tool (N, base axes), m/s; none when it is over.
    ///
    /// A force that grows instead of falling ends it: something else is in the way. It yields to the force as it is now, at full speed above twice the free force and slower below.
    pub fn step(&mut self, force: &Vector3, dt: f64) -> Option<Vector3> {
        let norm = force.norm();
        let Self { config: c, moved, time, start } = self;
        let falls = norm <= GROWTH * *start.get_or_insert(norm);
        let on = falls && norm > c.free_force && *moved < c.distance && *time < c.time_max;
        if !(on && norm.is_finite()) {
            return None;
        }
        let speed = c.speed * (0.5 * norm / c.free_force).min(1.0);
        *moved += speed * dt;
        *time += dt;
        Some(force * (speed / norm))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: RetreatConfig =
        RetreatConfig { distance: 0.005, speed: 0.01, free_force: 2.0, time_max: 1.0 };

    #[test]
    fn it_goes_along_the_force_and_ends_when_that_is_gone() {
        let mut retreat = Retreat::new(CONFIG);
        // A wall of 10 N/mm that was pressed 3 mm deep.
        let (mut depth, mut ticks) = (0.003, 0);
        while let Some(v) = retreat.step(&Vector3::new(0.0, 0.0, 1e4 * depth), 0.002) {
            assert!(v.x == 0.0 && v.z > 0.0 && v.z <= 0.01 + 1e-15);
            depth -= v.z * 0.002;
            ticks += 1;
        }
        assert!(1e4 * depth <= 2.0 && depth > 0.0, "{depth}");
        assert!(ticks < 180, "{ticks}");
    }

    #[test]
    fn it_is_short_whatever_the_force_says() {
        let mut retreat = Retreat::new(CONFIG);
        let mut moved = 0.0;
        while let Some(v) = retreat.step(&Vector3::new(0.0, 30.0, 0.0), 0.002) {
            moved += v.norm() * 0.002;
        }
        assert!((moved - 0.005).abs() < 3e-5, "{moved}");
        let mut wrong = Retreat::new(CONFIG);
        assert!(wrong.step(&Vector3::new(0.0, 30.0, 0.0), 0.002).is_some());
        assert_eq!(wrong.step(&Vector3::new(0.0, 40.0, 0.0), 0.002), None, "the force grows");
        assert_eq!(Retreat::new(CONFIG).step(&Vector3::new(f64::NAN, 0.0, 0.0), 0.002), None);
    }

    /// By 30 % of what it was at first, whatever it was in between.
    #[test]
    fn a_force_may_grow_a_little_before_it_falls() {
        let mut retreat = Retreat::new(CONFIG);
        for (newton, on) in [(30.0, true), (38.9, true), (20.0, true), (38.9, true), (39.1, false)]
        {
            let step = retreat.step(&Vector3::new(0.0, newton, 0.0), 0.002);
            assert_eq!(step.is_some(), on, "{newton} N");
        }
    }

    #[test]
    fn it_slows_down_towards_the_free_force_and_ends_at_it() {
        let speed = |newton: f64| Retreat::new(CONFIG).step(&Vector3::new(0.0, newton, 0.0), 0.002);
        assert!((speed(3.0).unwrap().y - 0.0075).abs() < 1e-15);
        assert!((speed(4.0).unwrap().y - 0.01).abs() < 1e-15);
        assert_eq!(speed(2.0), None);
    }

    #[test]
    fn its_way_and_its_time_end_it_exactly() {
        let force = Vector3::new(0.0, 30.0, 0.0);
        let steps = |config: RetreatConfig| {
            let mut retreat = Retreat::new(config);
            (0..9).take_while(|_| retreat.step(&force, 0.5).is_some()).count()
        };
        assert_eq!(steps(RetreatConfig { time_max: 9.0, ..CONFIG }), 1, "5 mm at 10 mm/s");
        assert_eq!(steps(RetreatConfig { distance: 1.0, ..CONFIG }), 2, "1 s");
    }
}
