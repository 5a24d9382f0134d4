//! The sampled mass-spring-damper.

use nalgebra::Complex;

/// Displacement and velocity of the model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct State {
    pub(crate) x: f64,
    pub(crate) v: f64,
}

/// F = m·ẍ + b·ẋ + k·x over one tick with F held: (x, v)⁺ = Φ·(x, v) + Γ·F.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Oscillator {
    xx: f64,
    xv: f64,
    xf: f64,
    vx: f64,
    vv: f64,
    vf: f64,
}

impl Oscillator {
    /// The exact sampling of the model with b = 2ζ√(k·m).
    ///
    /// With σ = ζω_n and ω_n = √(k/m), the free motion is spanned by
    /// c(t) = e^(−σt)·cos ωt and s(t) = e^(−σt)·sin(ωt)/ω, ω = ω_n√(1−ζ²), and by their hyperbolic
    /// forms where ζ > 1: Φ = [c + σs, s; −ω_n²s, c − σs].
    pub(crate) fn new(mass: f64, damping_ratio: f64, stiffness: f64, dt: f64) -> Self {
        let natural = (stiffness / mass).sqrt();
        let sigma = damping_ratio * natural;
        let (c, s) = free_motion(natural, damping_ratio, dt);
        let xx = c + sigma * s;
        Self {
            xx,
            xv: s,
            xf: (1.0 - xx) / stiffness,
            vx: -natural * natural * s,
            vv: c - sigma * s,
            vf: s / mass,
        }
    }

    pub(crate) fn step(&self, State { x, v }: State, force: f64) -> State {
        State {
            x: self.xx * x + self.xv * v + self.xf * force,
            v: self.vx * x + self.vv * v + self.vf * force,
        }
    }

    /// From force to the displacement after its tick, at z: z·[1 0]·(zI − Φ)⁻¹·Γ.
    pub(crate) fn response(&self, z: Complex<f64>) -> Complex<f64> {
        let determinant = z * z - z * (self.xx + self.vv) + (self.xx * self.vv - self.xv * self.vx);
        z * ((z - self.vv) * self.xf + self.xv * self.vf) / determinant
    }
}

/// c(t) and s(t) of [`Oscillator::new`].
fn free_motion(natural: f64, damping_ratio: f64, t: f64) -> (f64, f64) {
    let sigma = damping_ratio * natural;
    // ω² = ω_n²(1−ζ)(1+ζ): no cancellation near ζ = 1.
    let omega = natural * ((1.0 - damping_ratio) * (1.0 + damping_ratio)).abs().sqrt();
    let angle = omega * t;
    // sin(a)/a and sinh(a)/a at a → 0 differ from 1 by a²/6.
    if angle < 1e-8 {
        let decay = (-sigma * t).exp();
        return (decay, decay * t);
    }
    if damping_ratio < 1.0 {
        let decay = (-sigma * t).exp();
        return (decay * angle.cos(), decay * angle.sin() / omega);
    }
    // Two decaying exponentials; e^(−σt)·cosh(ωt) itself would overflow. The slow rate is
    // σ − ω = ω_n²/(σ + ω), again without cancellation.
    let slow = (-natural * natural / (sigma + omega) * t).exp();
    let fast = (-(sigma + omega) * t).exp();
    // slow − fast = slow·(1 − e^(−2ωt)), through expm1 for small ωt.
    (0.5 * (slow + fast), slow * -(-2.0 * angle).exp_m1() / (2.0 * omega))
}
