"""One update of soft actor-critic in PyTorch or JAX per line of standard input; prints its seconds of CPU.

    python3 python/peers.py torch|jax      # `cargo xtask bench` starts it where one of them is installed

The problem is that of crates/palpate-sac/examples/update_cost.rs: observation 18, action 14, two layers of 256, LayerNorm
without affine part in the critics, batch 256, float32, one thread; drawing the batch from a replay of 20,000 and the
normal numbers included. Both are as quick as we know to make them: critics frozen in the actor's loss, PyTorch with
fused Adam, foreach target tracking and no needless gradients; JAX as one jitted step with donated buffers and both
critics in one batched product.
"""

import os
import sys
import time

ONE = {"OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "JAX_PLATFORMS": "cpu"}
os.environ.update(ONE, XLA_FLAGS="--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")

import numpy as np

O, A, H, BATCH, ROWS = 18, 14, 256, 256, 20_000
RATE, TAU, LOW, HIGH, TARGET = 3e-4, 0.005, -5.0, 2.0, 0.0
EPSILON = 1e-5
draw = np.random.default_rng(1)
REPLAY = {
    "observation": draw.standard_normal((ROWS, O), dtype=np.float32),
    "action": draw.uniform(-1, 1, (ROWS, A)).astype(np.float32),
    "reward": draw.standard_normal(ROWS, dtype=np.float32),
    "discount": np.full(ROWS, 0.98**5, np.float32),
    "next": draw.standard_normal((ROWS, O), dtype=np.float32),
}


def layers(inputs, outputs):
    sizes = [inputs, H, H, outputs]
    pairs = [(i, o) for i, o in zip(sizes, sizes[1:])]
    return [x for i, o in pairs for x in (draw.uniform(-1, 1, (i, o)) / i**0.5, np.zeros(o))]


def batch():
    rows = draw.integers(ROWS, size=BATCH)
    noise = draw.standard_normal((2, BATCH, A), dtype=np.float32)
    return {k: v[rows] for k, v in REPLAY.items()} | {"noise": noise}


def torch_peer():
    import torch
    import torch.nn.functional as F

    torch.set_num_threads(1)
    tensors = lambda x: [torch.tensor(v, dtype=torch.float32, requires_grad=True) for v in x]
    actor, first, second = tensors(layers(O, 2 * A)), tensors(layers(O + A, 1)), tensors(layers(O + A, 1))
    critics = first + second
    targets = [x.detach().clone() for x in critics]
    frozen = [x.detach() for x in critics]
    log_alpha = torch.tensor([-4.0], requires_grad=True)
    adam = lambda x: torch.optim.Adam(x, lr=RATE, fused=True)
    adams = adam(actor), adam(critics), adam([log_alpha])

    def network(w, x, norm):
        for i in (0, 2):
            x = torch.addmm(w[i + 1], x, w[i])
            x = F.relu(F.layer_norm(x, (H,), eps=EPSILON) if norm else x)
        return torch.addmm(w[5], x, w[4])

    def policy(observation, noise):
        mean, raw = network(actor, observation, False).chunk(2, -1)
        log_std = LOW + 0.5 * (HIGH - LOW) * (torch.tanh(raw) + 1)
        u = mean + log_std.exp() * noise
        gauss = -0.5 * noise.square() - log_std - 0.5 * np.log(2 * np.pi)
        return torch.tanh(u), (gauss - 2 * (np.log(2) - u - F.softplus(-2 * u))).sum(-1)

    def values(w, x):
        return network(w[:6], x, True)[:, 0], network(w[6:], x, True)[:, 0]

    def update():
        b = {k: torch.from_numpy(v) for k, v in batch().items()}
        alpha = log_alpha.detach().exp()
        with torch.no_grad():
            action, log_p = policy(b["next"], b["noise"][0])
            q = torch.minimum(*values(targets, torch.cat([b["next"], action], -1)))
            y = b["reward"] + b["discount"] * (q - alpha * log_p)
        qs = values(critics, torch.cat([b["observation"], b["action"]], -1))
        loss = sum(0.5 * F.mse_loss(q, y) for q in qs)
        adams[1].zero_grad(set_to_none=True)
        loss.backward()
        adams[1].step()
        action, log_p = policy(b["observation"], b["noise"][1])
        q = torch.minimum(*values(frozen, torch.cat([b["observation"], action], -1)))
        loss = (alpha * log_p - q).mean()
        adams[0].zero_grad(set_to_none=True)
        loss.backward()
        adams[0].step()
        log_alpha.grad = (-log_p.detach().mean() - TARGET).reshape(1)
        adams[2].step()
        with torch.no_grad():
            torch._foreach_lerp_(targets, frozen, TAU)
        return loss.item()

    return f"torch {torch.__version__}", update


def jax_peer():
    import jax
    import jax.numpy as jnp

    single = lambda x: [jnp.asarray(v, jnp.float32) for v in x]
    twin = [jnp.stack(pair) for pair in zip(single(layers(O + A, 1)), single(layers(O + A, 1)))]
    weights = {"actor": single(layers(O, 2 * A)), "critics": twin, "alpha": jnp.array([-4.0])}
    zeros = jax.tree.map(jnp.zeros_like, weights)
    copies = lambda tree: jax.tree.map(jnp.copy, tree)
    state = (weights, copies(twin), zeros, copies(zeros), jnp.zeros(()))

    def network(w, x, norm):
        for i in (0, 2):
            x = x @ w[i] + w[i + 1]
            if norm:
                centred = x - x.mean(-1, keepdims=True)
                x = centred * jax.lax.rsqrt((centred**2).mean(-1, keepdims=True) + EPSILON)
            x = jax.nn.relu(x)
        return x @ w[4] + w[5]

    def policy(actor, observation, noise):
        mean, raw = jnp.split(network(actor, observation, False), 2, -1)
        log_std = LOW + 0.5 * (HIGH - LOW) * (jnp.tanh(raw) + 1)
        u = mean + jnp.exp(log_std) * noise
        gauss = -0.5 * noise**2 - log_std - 0.5 * np.log(2 * np.pi)
        return jnp.tanh(u), (gauss - 2 * (np.log(2) - u - jax.nn.softplus(-2 * u))).sum(-1)

    values = jax.vmap(lambda w, x: network(w, x, True)[:, 0], (0, None))

    def adam(w, g, m, v, step):
        m = jax.tree.map(lambda m, g: 0.9 * m + 0.1 * g, m, g)
        v = jax.tree.map(lambda v, g: 0.999 * v + 0.001 * g * g, v, g)
        rate, scale = RATE / (1 - 0.9**step), 1 / (1 - 0.999**step)
        return jax.tree.map(lambda w, m, v: w - rate * m / (jnp.sqrt(v * scale) + 1e-8), w, m, v), m, v

    def step(state, b):
        weights, targets, m, v, count = state
        count, alpha = count + 1, jnp.exp(weights["alpha"][0])
        action, log_p = policy(weights["actor"], b["next"], b["noise"][0])
        q = values(targets, jnp.concatenate([b["next"], action], -1)).min(0)
        y = b["reward"] + b["discount"] * (q - alpha * log_p)
        x = jnp.concatenate([b["observation"], b["action"]], -1)
        critic = jax.grad(lambda w: 0.5 * ((values(w, x) - y) ** 2).mean(-1).sum())(weights["critics"])
        critics, mc, vc = adam(weights["critics"], critic, m["critics"], v["critics"], count)

        def loss(w):
            action, log_p = policy(w, b["observation"], b["noise"][1])
            q = values(critics, jnp.concatenate([b["observation"], action], -1)).min(0)
            return (alpha * log_p - q).mean(), log_p

        (cost, log_p), actor = jax.value_and_grad(loss, has_aux=True)(weights["actor"])
        surplus = jnp.reshape(-log_p.mean() - TARGET, 1)
        rest = lambda tree: {"actor": tree["actor"], "alpha": tree["alpha"]}
        new, mr, vr = adam(rest(weights), {"actor": actor, "alpha": surplus}, rest(m), rest(v), count)
        targets = jax.tree.map(lambda t, c: t + TAU * (c - t), targets, critics)
        state = (new | {"critics": critics}, targets, mr | {"critics": mc}, vr | {"critics": vc}, count)
        return state, cost

    jitted = jax.jit(step, donate_argnums=0)

    def update():
        nonlocal state
        state, cost = jitted(state, batch())
        return float(cost)

    return f"jax {jax.__version__}", update


name, update = {"torch": torch_peer, "jax": jax_peer}[sys.argv[1]]()
for _ in range(5):
    update()
print(name, flush=True)
for _ in sys.stdin:
    began = time.process_time()
    if not np.isfinite(update()):
        sys.exit("the peer diverged")
    print(time.process_time() - began, flush=True)
