//! Where networks and batches live.

use candle_core::Device;
use serde::{Deserialize, Serialize};

use crate::SacError;

/// What computes the networks of an update. The policy that acts is always computed by the CPU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Processor {
    /// The CPU.
    #[default]
    Cpu,
    /// The first NVIDIA GPU, with [`Ops::Plain`](crate::Ops::Plain); needs the feature `cuda`.
    Cuda,
}

impl Processor {
    /// candle's device.
    pub(crate) fn device(self) -> Result<Device, SacError> {
        match self {
            Self::Cpu => Ok(Device::Cpu),
            Self::Cuda => Device::new_cuda(0).map_err(|e| {
                // With RUST_BACKTRACE set candle's message brings its backtrace along.
                SacError::Cuda(e.to_string().lines().next().unwrap_or_default().into())
            }),
        }
    }
}

#[cfg(all(test, not(feature = "cuda")))]
mod tests {
    use crate::{Ops, Processor, Sac, SacConfig};

    #[test]
    fn without_a_gpu_the_error_says_what_it_takes() {
        let config = SacConfig { device: Processor::Cuda, ops: Ops::Plain, ..SacConfig::default() };
        let error = Sac::new(&config, 2, 1, 1).unwrap_err().to_string();
        assert!(error.contains("--features cuda"), "{error}");
    }
}
