//! What the control program does with its registers, once per tick.

use super::World;

/// The state of a running control program.
#[derive(Clone, Debug)]
pub(crate) struct Program {
    token: i32,
    stall: u32,
    step_max: f64,
    status: i32,
    taken: i32,
    silent: u32,
    tares: i32,
    last_mode: i32,
    /// Ticks until a tare is done.
    taring: u32,
}

impl Program {
    pub(crate) fn from_text(text: &str) -> Option<Self> {
        let number = |name: &str| {
            let line = text.lines().find(|l| l.trim().starts_with(&format!("{name} = ")))?;
            line.split(['=', ',']).nth(1)?.trim().trim_matches(['[', ']']).parse::<f64>().ok()
        };
        Some(Self {
            token: number("TOKEN")? as i32,
            stall: number("STALL_CYCLES")? as u32,
            step_max: number("MAX_STEP")?,
            status: 1,
            taken: -1,
            silent: 0,
            tares: 0,
            last_mode: 0,
            taring: 0,
        })
    }
}

/// One cycle. Leaves the joints' goal in `world.target`.
pub(crate) fn cycle(world: &mut World) {
    let Some(mut p) = world.program.take() else { return };
    let (mode, sequence) = (world.ints[24], world.ints[25]);
    let fresh = world.ints[26] == p.token && sequence != p.taken;
    let gap = (sequence - p.taken).rem_euclid(1_000_000_000).min(p.stall.cast_signed());
    if fresh {
        (p.taken, p.silent) = (sequence, 0);
    } else {
        p.silent += 1;
    }
    let q: [f64; 6] = std::array::from_fn(|n| world.doubles[24 + n]);
    let whole = (q.iter().fold(f64::from(sequence), |a, x| a + x) - world.doubles[30]).abs() < 1e-6;
    let near = |from: &[f64; 6], by: f64| from.iter().zip(&q).all(|(a, b)| (a - b).abs() <= by);
    if p.taring > 0 {
        p.taring -= 1;
        if p.taring == 0 {
            world.tare = world.load;
            p.tares += 1;
        }
    } else if p.status == 2 {
        if fresh && mode == 1 {
            if whole && near(&world.target, p.step_max * 2.0 * f64::from(gap)) {
                world.target = q;
            } else {
                p.status = 7;
            }
        } else if fresh {
            p.status = if mode == 2 { 5 } else { 1 };
            p.last_mode = 1;
        } else if p.silent >= p.stall {
            p.status = 6;
        }
    } else if fresh {
        match mode {
            0 => p.status = 1,
            1 if p.status == 1 => {
                if whole && near(&world.q, 0.02) {
                    p.status = 2;
                    world.target = q;
                } else {
                    p.status = 7;
                }
            }
            2 => p.status = 5,
            3 if p.status == 1 && p.last_mode != 3 => p.taring = 20,
            4 => {
                p.status = 8;
                world.runtime = 1;
            }
            _ => {}
        }
        p.last_mode = mode;
    }
    world.out[24] = 1;
    world.out[25] = p.taken;
    world.out[26] = p.status;
    world.out[27] += 1;
    world.out[28] = p.token;
    world.out[29] = p.tares;
    world.out[30] = i32::from(p.status == 7) * 3;
    if p.status != 8 {
        world.program = Some(p);
    }
}
