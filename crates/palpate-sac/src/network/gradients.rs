//! Gradients of a network: fused and plain against differences of an f64 transcription.

use candle_core::{Device, Tensor, Var};

use super::*;
use crate::rng::{Streams, fill_normal};
use crate::team::Team;

const BATCH: usize = 7;
const HELD: usize = 3;
const MOVING: usize = 2;

fn engine(ops: Ops, threads: usize) -> Engine {
    Engine { ops, device: Device::Cpu, team: Arc::new(Team::new(threads)) }
}

fn draw(count: usize, stream: u64) -> Vec<f32> {
    let mut values = vec![0.0; count];
    fill_normal(&mut Streams::new(stream).update, &mut values);
    values
}

/// Σ wᵢ outᵢ for input rows x, straight from the definition.
fn reference(shape: &Shape, parameters: &[f64], x: &[f64], weights: &[f32]) -> f64 {
    let (layers, mut total) = (shape.layers(), 0.0);
    for (row, weights) in x.chunks(shape.inputs()).zip(weights.chunks(shape.outputs())) {
        let mut y = row.to_vec();
        for (index, layer) in layers.iter().enumerate() {
            let (w, b) = (&parameters[layer.weight.clone()], &parameters[layer.bias.clone()]);
            let mut z: Vec<f64> = (0..layer.outputs)
                .map(|o| {
                    b[o] + (0..layer.inputs).map(|i| y[i] * w[i * layer.outputs + o]).sum::<f64>()
                })
                .collect();
            if index + 1 < layers.len() {
                if shape.layer_norm {
                    let n = z.len() as f64;
                    let mean = z.iter().sum::<f64>() / n;
                    let variance = z.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / n;
                    for z in &mut z {
                        *z = (*z - mean) / (variance + 1e-5).sqrt();
                    }
                }
                for z in &mut z {
                    *z = z.max(0.0);
                }
            }
            y = z;
        }
        total += y.iter().zip(weights).map(|(y, w)| y * f64::from(*w)).sum::<f64>();
    }
    total
}

/// Gradients of Σ wᵢ outᵢ: of the parameters, then of the right-hand input columns.
fn gradients(
    ops: Ops,
    shape: &Shape,
    parameters: &[f32],
    x: &[f32],
    weights: &[f32],
) -> [Vec<f32>; 2] {
    let network = Network::new(&engine(ops, 2), shape.clone(), parameters.to_vec()).unwrap();
    let rows = Tensor::from_slice(x, (BATCH, HELD + MOVING), &Device::Cpu).unwrap();
    let held = rows.narrow(1, 0, HELD).unwrap();
    let moving = Var::from_tensor(&rows.narrow(1, HELD, MOVING).unwrap().contiguous().unwrap());
    let moving = moving.unwrap();
    let weights = Tensor::from_slice(weights, (BATCH, shape.outputs()), &Device::Cpu).unwrap();
    let backward = |flow| {
        let out = network.call(Some(&held), moving.as_tensor(), flow).unwrap();
        (out * &weights).unwrap().sum_all().unwrap().backward().unwrap()
    };
    let through = backward(Flow::Input);
    let through = through.get(&moving).unwrap().flatten_all().unwrap().to_vec1().unwrap();
    let trained = backward(Flow::Parameters);
    let own = match ops {
        Ops::Fused => lock(&network.area).unwrap().take_gradient().unwrap().to_vec(),
        Ops::Plain => trained.get(network.variable().as_tensor()).unwrap().to_vec1().unwrap(),
    };
    [own, through]
}

fn check(layer_norm: bool, outputs: usize) {
    // 21 units: more than one block of the running sums, and no multiple of it.
    let shape = Shape::new(HELD + MOVING, &[21, 17], outputs, layer_norm);
    let parameters: Vec<f32> = draw(shape.parameters(), 1).iter().map(|p| 0.5 * p).collect();
    let (x, weights) = (draw(BATCH * shape.inputs(), 2), draw(BATCH * outputs, 3));
    let [p64, x64] = [&parameters, &x].map(|v| v.iter().map(|x| f64::from(*x)).collect::<Vec<_>>());
    let step = 1e-6;
    let slope = |at: &dyn Fn(f64) -> f64| (at(step) - at(-step)) / (2.0 * step);
    let own = (0..p64.len()).map(|i| {
        slope(&|delta| {
            let mut moved = p64.clone();
            moved[i] += delta;
            reference(&shape, &moved, &x64, &weights)
        })
    });
    let own: Vec<f64> = own.collect();
    let through = (0..BATCH * MOVING).map(|i| {
        slope(&|delta| {
            let mut moved = x64.clone();
            moved[i / MOVING * shape.inputs() + HELD + i % MOVING] += delta;
            reference(&shape, &p64, &moved, &weights)
        })
    });
    let through: Vec<f64> = through.collect();
    for ops in [Ops::Fused, Ops::Plain] {
        let got = gradients(ops, &shape, &parameters, &x, &weights);
        for (got, slopes) in got.iter().zip([&own, &through]) {
            assert_eq!(got.len(), slopes.len());
            let size = (slopes.iter().map(|s| s * s).sum::<f64>() / slopes.len() as f64).sqrt();
            assert!(size > 0.0);
            for (i, (got, slope)) in got.iter().zip(slopes).enumerate() {
                let error = (f64::from(*got) - slope).abs();
                assert!(error <= 1e-4 * size.max(slope.abs()), "{ops:?} {i}: {got} {slope}");
            }
        }
    }
}

#[test]
fn of_an_actor_match_finite_differences() {
    check(false, 4);
}

#[test]
fn of_a_layer_norm_critic_match_finite_differences() {
    check(true, 1);
}

/// Outputs of a pair, gradient of the input, gradients of both networks' parameters.
fn pair(
    ops: Ops,
    threads: usize,
    batch: usize,
    hidden: &[usize],
    layer_norm: bool,
) -> Vec<Vec<f32>> {
    let shape = Shape::new(HELD + MOVING, hidden, 1, layer_norm);
    let engine = engine(ops, threads);
    let network = |stream| {
        let parameters = draw(shape.parameters(), stream).iter().map(|p| 0.3 * p).collect();
        Network::new(&engine, shape.clone(), parameters).unwrap()
    };
    let networks = [network(1), network(2)];
    let tensor = |columns: usize, stream| {
        Tensor::from_vec(draw(batch * columns, stream), (batch, columns), &Device::Cpu).unwrap()
    };
    let (held, weights) = (tensor(HELD, 3), tensor(2, 4));
    let moving = Var::from_tensor(&tensor(MOVING, 5)).unwrap();
    let flat = |t: &Tensor| t.flatten_all().unwrap().to_vec1::<f32>().unwrap();
    let mut results = Vec::new();
    for flow in [Flow::Input, Flow::Parameters] {
        let out = Network::call_both(&networks, Some(&held), moving.as_tensor(), flow).unwrap();
        results.push(flat(&out));
        let gradients = (out * &weights).unwrap().sum_all().unwrap().backward().unwrap();
        match (flow, ops) {
            (Flow::Input, _) => results.push(flat(gradients.get(&moving).unwrap())),
            (_, Ops::Plain) => {
                results.extend(networks.iter().map(|n| flat(gradients.get(&n.variable).unwrap())));
            }
            (_, Ops::Fused) => results.extend(
                networks.iter().map(|n| lock(&n.area).unwrap().take_gradient().unwrap().to_vec()),
            ),
        }
    }
    results
}

/// Sizes with whole blocks and with remainders, batches too small for two halves, a network of one layer.
const SIZES: [(usize, &[usize]); 6] =
    [(256, &[64, 32]), (77, &[40, 24]), (16, &[33, 70]), (9, &[8, 8]), (1, &[16, 16]), (256, &[])];

#[test]
fn of_a_pair_match_plain_operations() {
    for (batch, hidden) in SIZES {
        for layer_norm in [false, true] {
            let plain = pair(Ops::Plain, 1, batch, hidden, layer_norm);
            let fused = pair(Ops::Fused, 2, batch, hidden, layer_norm);
            for (fused, plain) in fused.iter().zip(&plain) {
                assert_eq!(fused.len(), plain.len());
                let size = plain.iter().fold(0.0f32, |size, p| size.max(p.abs()));
                assert!(size > 0.0);
                for (f, p) in fused.iter().zip(plain) {
                    assert!((f - p).abs() <= 2e-5 * size, "{batch} {hidden:?}: {f} {p}");
                }
            }
        }
    }
}

#[test]
fn do_not_depend_on_threads() {
    for (batch, hidden) in SIZES {
        let bits = |threads| {
            let results = pair(Ops::Fused, threads, batch, hidden, true);
            let shape = Shape::new(HELD + MOVING, hidden, 3, false);
            let parameters = draw(shape.parameters(), 6);
            let alone = Network::new(&engine(Ops::Fused, threads), shape, parameters).unwrap();
            let x = draw(batch * (HELD + MOVING), 7);
            let x = Tensor::from_vec(x, (batch, HELD + MOVING), &Device::Cpu).unwrap();
            let out = alone.call(None, &x, Flow::Parameters).unwrap();
            out.sqr().unwrap().sum_all().unwrap().backward().unwrap();
            let own = lock(&alone.area).unwrap().take_gradient().unwrap().to_vec();
            results.into_iter().flatten().chain(own).map(f32::to_bits).collect::<Vec<_>>()
        };
        assert_eq!(bits(1), bits(2), "{batch} {hidden:?}");
    }
}

#[test]
fn a_backward_pass_after_a_later_forward_pass_is_refused() {
    let shape = Shape::new(2, &[4], 1, true);
    let network =
        Network::new(&engine(Ops::Fused, 1), shape.clone(), draw(shape.parameters(), 4)).unwrap();
    let x = Tensor::from_slice(&draw(6, 5), (3, 2), &Device::Cpu).unwrap();
    let first = network.call(None, &x, Flow::Parameters).unwrap();
    network.call(None, &x, Flow::Nowhere).unwrap();
    let error = first.sum_all().unwrap().backward().unwrap_err();
    assert!(error.to_string().contains("later pass"), "{error}");
    // Nor is there a second one.
    let loss = network.call(None, &x, Flow::Parameters).unwrap().sum_all().unwrap();
    loss.backward().unwrap();
    let error = loss.backward().unwrap_err();
    assert!(error.to_string().contains("later pass"), "{error}");
}
