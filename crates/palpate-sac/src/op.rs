//! Whole networks as one candle operation each.
//!
//! candle keeps the graph, the variables and the losses; these operations compute the networks. Their
//! backward pass returns the gradient of the input through candle and leaves the gradient of the
//! parameters in the work area, where the optimiser reads it: handed to candle, a gradient of 77,000
//! numbers would be copied twice and summed on a spinning thread pool.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};

use candle_core::{
    CpuStorage, CustomOp2, CustomOp3, Error, Layout, Result, Shape as TensorShape, Storage, Tensor,
    bail,
};

use crate::mlp::Shape;
use crate::team::Team;
use crate::work::{Wanted, Work};

/// Work area of one network, shared by the operations it takes part in.
#[derive(Debug, Default)]
pub(crate) struct Area {
    work: Work,
    /// Counts passes that write: a backward pass must find the values of its own forward pass.
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

    pub(crate) fn parameters_changed(&mut self) {
        self.work.parameters_changed();
    }
}

pub(crate) fn lock(area: &Mutex<Area>) -> Result<MutexGuard<'_, Area>> {
    area.lock().map_err(|e| Error::Msg(format!("work area of a network: {e}")))
}

/// What networks are called with beside the tensors that candle knows.
pub(crate) struct Call {
    pub(crate) team: Arc<Team>,
    /// Left-hand input columns, constant: they get no gradient.
    pub(crate) held: Option<Tensor>,
    /// Whether the gradient of the parameters is wanted.
    pub(crate) train: bool,
    /// Whether the gradient of the right-hand columns is wanted.
    pub(crate) through: bool,
}

/// One network's part in an operation.
pub(crate) struct Part {
    shape: Arc<Shape>,
    area: Arc<Mutex<Area>>,
    /// The forward pass made here.
    pass: AtomicU64,
}

/// A tensor as operations are given it.
type Given<'a> = (&'a CpuStorage, &'a Layout);

impl Part {
    pub(crate) fn new(shape: &Arc<Shape>, area: &Arc<Mutex<Area>>) -> Self {
        Self { shape: Arc::clone(shape), area: Arc::clone(area), pass: AtomicU64::new(0) }
    }

    fn forward(
        &self,
        area: &mut Area,
        call: &Call,
        (x, x_layout): Given<'_>,
        (parameters, parameters_layout): Given<'_>,
        team: Option<&Team>,
    ) -> Result<()> {
        let (batch, columns) = x_layout.shape().dims2()?;
        area.passes += 1;
        area.fresh = false;
        self.pass.store(area.passes, Ordering::Relaxed);
        let inputs = self.shape.inputs();
        let [first, second] = area.work.prepare(&self.shape, batch);
        let mut rows = [first, second];
        let left = inputs.checked_sub(columns).unwrap_or(usize::MAX);
        match &call.held {
            Some(held) => {
                if held.dims() != [batch, left] {
                    bail!(
                        "network of {inputs} inputs given {:?} beside {batch} x {columns}",
                        held.dims()
                    );
                }
                let (storage, layout) = held.storage_and_layout();
                copy_columns(cpu(&storage)?, layout, &mut rows, inputs, 0)?;
            }
            None if left == 0 => {}
            None => bail!("network of {inputs} inputs given {columns}"),
        }
        copy_columns(x, x_layout, &mut rows, inputs, left)?;
        let parameters = contiguous(parameters, parameters_layout)?;
        area.work.forward(&self.shape, parameters, call.train || call.through, team);
        Ok(())
    }

    /// `d_output` has one row per row of the batch; this network's numbers begin at `at`.
    fn backward(
        &self,
        area: &mut Area,
        call: &Call,
        columns: usize,
        parameters: &Tensor,
        (d_output, at): (&Tensor, usize),
        team: Option<&Team>,
    ) -> Result<()> {
        if area.passes != self.pass.load(Ordering::Relaxed) {
            bail!("backward of a network whose work area holds a later pass");
        }
        let (inputs, outputs) = (self.shape.inputs(), self.shape.outputs());
        let width = d_output.dim(1)?;
        let (storage, layout) = d_output.storage_and_layout();
        let mut rows = contiguous(cpu(&storage)?, layout)?.chunks_exact(width);
        for half in area.work.d_output() {
            for (to, from) in half.chunks_exact_mut(outputs).zip(&mut rows) {
                to.copy_from_slice(&from[at..at + outputs]);
            }
        }
        let wanted = Wanted {
            parameters: call.train,
            input: if call.through { inputs - columns..inputs } else { 0..0 },
        };
        let (p_storage, p_layout) = parameters.storage_and_layout();
        area.work.backward(&self.shape, contiguous(cpu(&p_storage)?, p_layout)?, &wanted, team);
        if call.train {
            area.fresh = true;
            // What the forward pass left has been used up.
            area.passes += 1;
        }
        Ok(())
    }
}

/// One network, as a function of (right-hand input columns, parameters).
pub(crate) struct NetworkOp {
    pub(crate) call: Call,
    pub(crate) part: Part,
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
        let Self { call, part } = self;
        let mut area = lock(&part.area)?;
        let given = (parameters, parameters_layout);
        part.forward(&mut area, call, (x, x_layout), given, Some(&call.team))?;
        let output = area.work.output().concat();
        Ok((CpuStorage::F32(output), (x_layout.dims()[0], part.shape.outputs()).into()))
    }

    fn bwd(
        &self,
        x: &Tensor,
        parameters: &Tensor,
        _result: &Tensor,
        d_result: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let Self { call, part } = self;
        let (batch, columns) = x.dims2()?;
        let d_result = d_result.contiguous()?;
        let mut area = lock(&part.area)?;
        let team = Some(&*call.team);
        part.backward(&mut area, call, columns, parameters, (&d_result, 0), team)?;
        let d_input =
            || Tensor::from_vec(area.work.d_input().concat(), (batch, columns), x.device());
        Ok((call.through.then(d_input).transpose()?, None))
    }
}

/// Two networks of one shape at the same input, as a function of (right-hand input columns, parameters of
/// the first, of the second); rows (output of the first | output of the second).
///
/// Each network is a thread's, if there are two.
pub(crate) struct PairOp {
    pub(crate) call: Call,
    pub(crate) parts: [Part; 2],
}

impl CustomOp3 for PairOp {
    fn name(&self) -> &'static str {
        "network pair"
    }

    fn cpu_fwd(
        &self,
        x: &CpuStorage,
        x_layout: &Layout,
        first: &CpuStorage,
        first_layout: &Layout,
        second: &CpuStorage,
        second_layout: &Layout,
    ) -> Result<(CpuStorage, TensorShape)> {
        let Self { call, parts: [a, b] } = self;
        let (mut area_a, mut area_b) = (lock(&a.area)?, lock(&b.area)?);
        let (work_a, work_b, x) = (&mut *area_a, &mut *area_b, (x, x_layout));
        let (done_a, done_b) = call.team.both(
            || a.forward(work_a, call, x, (first, first_layout), None),
            || b.forward(work_b, call, x, (second, second_layout), None),
        );
        done_a.and(done_b)?;
        let outputs = a.shape.outputs();
        let batch = x_layout.dims()[0];
        let mut packed = Vec::with_capacity(2 * batch * outputs);
        for (a, b) in area_a.work.output().into_iter().zip(area_b.work.output()) {
            for (a, b) in a.chunks_exact(outputs).zip(b.chunks_exact(outputs)) {
                packed.extend_from_slice(a);
                packed.extend_from_slice(b);
            }
        }
        Ok((CpuStorage::F32(packed), (batch, 2 * outputs).into()))
    }

    fn bwd(
        &self,
        x: &Tensor,
        first: &Tensor,
        second: &Tensor,
        _result: &Tensor,
        d_result: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>, Option<Tensor>)> {
        let Self { call, parts: [a, b] } = self;
        let (batch, columns) = x.dims2()?;
        let d_result = d_result.contiguous()?;
        let (mut area_a, mut area_b) = (lock(&a.area)?, lock(&b.area)?);
        let (work_a, work_b) = (&mut *area_a, &mut *area_b);
        let (done_a, done_b) = call.team.both(
            || a.backward(work_a, call, columns, first, (&d_result, 0), None),
            || b.backward(work_b, call, columns, second, (&d_result, a.shape.outputs()), None),
        );
        done_a.and(done_b)?;
        let d_input = || {
            let mut sum = area_a.work.d_input().concat();
            let second = area_b.work.d_input();
            for (sum, d) in sum.iter_mut().zip(second.into_iter().flatten()) {
                *sum += d;
            }
            Tensor::from_vec(sum, (batch, columns), x.device())
        };
        Ok((call.through.then(d_input).transpose()?, None, None))
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

/// Copies a matrix into columns of two pieces of rows, which are `width` wide, from column `at` on.
fn copy_columns(
    storage: &CpuStorage,
    layout: &Layout,
    rows: &mut [&mut [f32]; 2],
    width: usize,
    at: usize,
) -> Result<()> {
    let (_, columns) = layout.shape().dims2()?;
    let &[row_stride, 1] = layout.stride() else {
        bail!("expected a matrix with contiguous rows, got {layout:?}");
    };
    let values = &storage.as_slice::<f32>()?[layout.start_offset()..];
    let rows = rows.iter_mut().flat_map(|piece| piece.chunks_exact_mut(width));
    for (index, row) in rows.enumerate() {
        let from = index * row_stride;
        row[at..at + columns].copy_from_slice(&values[from..from + columns]);
    }
    Ok(())
}
