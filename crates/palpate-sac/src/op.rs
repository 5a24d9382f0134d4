//! A whole network as one candle operation.
//!
//! candle keeps the graph, the variables and the losses; this operation computes the network. Its
//! backward pass returns the gradient of the input through candle and leaves the gradient of the
//! parameters in the work area, where the optimiser reads it: handed to candle, a gradient of 77,000
//! numbers would be copied twice and summed on a spinning thread pool.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};

use candle_core::{
    CpuStorage, CustomOp2, Error, Layout, Result, Shape as TensorShape, Storage, Tensor, bail,
};

use crate::mlp::{Shape, Wanted, Work};

/// Work area of one network, shared by the operations it takes part in.
#[derive(Debug, Default)]
pub(crate) struct Area {
    work: Work,
    /// Counts forward passes: a backward pass must find the values of its own.
    passes: u64,
    /// Whether the gradient belongs to a backward pass that nobody has used yet.
    fresh: bool,
}

impl Area {
    /// The gradient of the parameters from the latest backward pass, once.
    pub(crate) fn take_gradient(&mut self) -> Result<&[f32]> {
        if !std::mem::take(&mut self.fresh) {
            bail!("no new gradient of the parameters: backward did not pass through the network");
        }
        Ok(&self.work.gradient)
    }
}

pub(crate) fn lock(area: &Mutex<Area>) -> Result<MutexGuard<'_, Area>> {
    area.lock().map_err(|e| Error::Msg(format!("work area of a network: {e}")))
}

/// The network of `shape`, as a function of (right-hand input columns, parameters).
pub(crate) struct NetworkOp {
    pub(crate) shape: Arc<Shape>,
    pub(crate) area: Arc<Mutex<Area>>,
    /// Left-hand input columns, constant: they get no gradient.
    pub(crate) held: Option<Tensor>,
    /// Whether the gradient of the parameters is wanted.
    pub(crate) train: bool,
    /// Whether the gradient of the right-hand columns is wanted.
    pub(crate) through: bool,
    /// The forward pass this operation made.
    pub(crate) pass: AtomicU64,
}

impl CustomOp2 for NetworkOp {
    fn name(&self) -> &'static str {
        "network"
    }

    fn cpu_fwd(
        &self,
        x: &CpuStorage,
        x_layout: &Layout,
        parameters: &CpuStorage,
        parameters_layout: &Layout,
    ) -> Result<(CpuStorage, TensorShape)> {
        let (batch, columns) = x_layout.shape().dims2()?;
        let mut area = lock(&self.area)?;
        let area = &mut *area;
        area.passes += 1;
        area.fresh = false;
        self.pass.store(area.passes, Ordering::Relaxed);

        let inputs = self.shape.inputs();
        let input = area.work.prepare(&self.shape, batch);
        let left = inputs.checked_sub(columns).unwrap_or(usize::MAX);
        match &self.held {
            Some(held) => {
                if held.dims() != [batch, left] {
                    bail!(
                        "network of {inputs} inputs given {:?} beside {batch} x {columns}",
                        held.dims()
                    );
                }
                let (storage, layout) = held.storage_and_layout();
                copy_columns(cpu(&storage)?, layout, input, inputs, 0)?;
            }
            None if left == 0 => {}
            None => bail!("network of {inputs} inputs given {columns}"),
        }
        copy_columns(x, x_layout, input, inputs, left)?;

        let mut output = vec![0.0; batch * self.shape.outputs()];
        area.work.forward(&self.shape, contiguous(parameters, parameters_layout)?, &mut output);
        Ok((CpuStorage::F32(output), (batch, self.shape.outputs()).into()))
    }

    fn bwd(
        &self,
        x: &Tensor,
        parameters: &Tensor,
        _result: &Tensor,
        d_result: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let (batch, columns) = x.dims2()?;
        let mut area = lock(&self.area)?;
        if area.passes != self.pass.load(Ordering::Relaxed) {
            bail!("backward of a network whose work area holds a later forward pass");
        }
        let inputs = self.shape.inputs();
        let wanted = Wanted {
            parameters: self.train,
            input: if self.through { inputs - columns..inputs } else { 0..0 },
        };
        let d_result = d_result.contiguous()?;
        let (d_storage, d_layout) = d_result.storage_and_layout();
        let (p_storage, p_layout) = parameters.storage_and_layout();
        let mut d_input = vec![0.0; batch * wanted.input.len()];
        area.work.backward(
            &self.shape,
            contiguous(cpu(&p_storage)?, p_layout)?,
            contiguous(cpu(&d_storage)?, d_layout)?,
            &wanted,
            &mut d_input,
        );
        area.fresh |= self.train;
        let d_x = self
            .through
            .then(|| Tensor::from_vec(d_input, (batch, columns), x.device()))
            .transpose()?;
        Ok((d_x, None))
    }
}

/// The values of a tensor on the CPU.
pub(crate) fn cpu(storage: &Storage) -> Result<&CpuStorage> {
    match storage {
        Storage::Cpu(storage) => Ok(storage),
        _ => bail!("the fused operations run on the CPU; use ops = \"plain\" on a device"),
    }
}

/// The values of a contiguous tensor, in order.
pub(crate) fn contiguous<'a>(storage: &'a CpuStorage, layout: &Layout) -> Result<&'a [f32]> {
    match layout.contiguous_offsets() {
        Some((from, to)) => Ok(&storage.as_slice::<f32>()?[from..to]),
        None => bail!("expected a contiguous tensor, got {layout:?}"),
    }
}

/// Copies a matrix into columns of `rows`, which are `width` wide, from column `at` on.
fn copy_columns(
    storage: &CpuStorage,
    layout: &Layout,
    rows: &mut [f32],
    width: usize,
    at: usize,
) -> Result<()> {
    let (_, columns) = layout.shape().dims2()?;
    let &[row_stride, 1] = layout.stride() else {
        bail!("expected a matrix with contiguous rows, got {layout:?}");
    };
    let values = &storage.as_slice::<f32>()?[layout.start_offset()..];
    for (index, row) in rows.chunks_exact_mut(width).enumerate() {
        let from = index * row_stride;
        row[at..at + columns].copy_from_slice(&values[from..from + columns]);
    }
    Ok(())
}
