//! What the controller makes of the force/torque sensor, and how that can be spoilt.

use palpate_spatial::{UnitQuaternion, Vector3, Vector6, Wrench};

/// A defect of the force/torque sensor; tool axes, N and N·m.
#[derive(Clone, Debug, PartialEq)]
pub enum SensorFault {
    /// Adds this from now on.
    Bias([f64; 6]),
    /// Adds this every second.
    Drift([f64; 6]),
    /// Reads NaN.
    NotANumber,
    /// Repeats its last reading.
    Stuck,
    /// Cannot read beyond ± force, ± torque.
    Saturated(f64, f64),
    /// In order again.
    None,
}

/// The defects in force.
#[derive(Clone, Debug, Default)]
pub struct SensorFaults {
    bias: Vector6,
    drift: Vector6,
    drifted: Vector6,
    nan: bool,
    stuck: Option<Vector6>,
    range: Option<(f64, f64)>,
}

impl SensorFaults {
    pub(crate) fn inject(&mut self, fault: &SensorFault, reading: &Vector6) {
        match fault {
            SensorFault::Bias(bias) => self.bias += Vector6::from(*bias),
            SensorFault::Drift(rate) => self.drift = Vector6::from(*rate),
            SensorFault::NotANumber => self.nan = true,
            SensorFault::Stuck => self.stuck = Some(*reading),
            SensorFault::Saturated(force, torque) => self.range = Some((*force, *torque)),
            SensorFault::None => *self = Self::default(),
        }
    }

    fn spoil(&mut self, load: Vector6, dt: f64) -> Vector6 {
        self.drifted += self.drift * dt;
        let mut reading = load + self.bias + self.drifted;
        if let Some((force, torque)) = self.range {
            for (axis, value) in reading.iter_mut().enumerate() {
                let range = if axis < 3 { force } else { torque };
                *value = value.clamp(-range, range);
            }
        }
        if self.nan { Vector6::repeat(f64::NAN) } else { self.stuck.unwrap_or(reading) }
    }
}

/// The sensor between plant and program.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sensor {
    pub(crate) faults: SensorFaults,
    /// What `zero_ftsensor` subtracts, tool axes.
    zero: Vector6,
    /// Not tared, tool axes.
    pub(crate) raw: Vector6,
    /// Payload-compensated and tared, base axes.
    pub(crate) base: Vector6,
}

impl Sensor {
    /// Takes in the plant's wrench and the weight that the payload setting does not account for, tool axes.
    pub(crate) fn measure(
        &mut self,
        wrench: &Wrench,
        weight: &Vector6,
        base_R_tool: &UnitQuaternion,
        dt: f64,
    ) {
        self.raw = self.faults.spoil(wrench.vector() + weight, dt);
        self.base = rotate(&(self.raw - self.zero), base_R_tool);
    }

    pub(crate) fn tare(&mut self) {
        self.zero = self.raw;
        self.base = Vector6::zeros();
    }
}

fn rotate(tool: &Vector6, base_R_tool: &UnitQuaternion) -> Vector6 {
    let wrench = Wrench::new(tool.fixed_rows::<3>(0).into(), tool.fixed_rows::<3>(3).into());
    wrench.rotated(base_R_tool).vector()
}

/// Weight of a mass at a point in tool axes about the tool's origin; `down` is a unit vector in tool axes.
pub(crate) fn weight(mass: f64, centre: &[f64; 3], down: &Vector3) -> Vector6 {
    const G: f64 = 9.82;
    let force = down * (mass * G);
    let torque = Vector3::from(*centre).cross(&force);
    Wrench::new(force, torque).vector()
}
