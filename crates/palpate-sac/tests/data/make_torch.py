"""Twenty updates of soft actor-critic in PyTorch (float64), as a fixture for src/golden.rs.

    python3 -m venv venv && venv/bin/pip install torch safetensors numpy
    venv/bin/python crates/palpate-sac/tests/data/make_torch.py

Written from Haarnoja et al. 2018 (arXiv 1812.05905), with torch's own autograd, layer_norm, Adam and
tanh transform. The fixture holds first weights, batches, noise, what every update reports and the last
weights, with LayerNorm in the critics ("norm") and without ("bare"). Weights are (inputs, outputs).

The derivative of ReLU at 0 plays no part: the script refuses a fixture in which a pre-activation comes
closer to zero than float32 rounding could move it.
"""

import math
from pathlib import Path

import torch
import torch.nn.functional as F
from safetensors.torch import save_file

OBSERVATION, ACTION, HIDDEN, BATCH, UPDATES = 5, 3, (16, 16), 8, 20
ACTOR_RATE, CRITIC_RATE, ALPHA_RATE = 1e-3, 2e-3, 3e-3
ALPHA, TAU, TARGET_ENTROPY, LOG_STD = 0.2, 0.05, -3.0, (-5.0, 2.0)

torch.set_default_dtype(torch.float64)
generator = torch.Generator().manual_seed(20)


def single(x):
    """The nearest float32: what the fixture holds is what is computed with."""
    return x.float().double()


def normal(*shape):
    return single(torch.randn(*shape, generator=generator))


def first_weights(inputs, outputs):
    sizes = [inputs, *HIDDEN, outputs]
    layers = []
    for i, o in zip(sizes, sizes[1:]):
        layers += [single(normal(i, o) / math.sqrt(i)), single(0.3 * normal(o))]
    return layers


FIRST = {"actor": first_weights(OBSERVATION, 2 * ACTION)}
for number in "12":
    FIRST[f"critic_{number}"] = first_weights(OBSERVATION + ACTION, 1)
    FIRST[f"target_{number}"] = first_weights(OBSERVATION + ACTION, 1)
FACTORS = torch.tensor([0.0, 0.98, 0.98**2, 0.98**5])
BATCHES = {
    "observation": normal(UPDATES, BATCH, OBSERVATION),
    "action": single(torch.tanh(normal(UPDATES, BATCH, ACTION))),
    "reward": normal(UPDATES, BATCH),
    "discount": single(FACTORS[torch.randint(4, (UPDATES, BATCH), generator=generator)]),
    "bootstrap_observation": normal(UPDATES, BATCH, OBSERVATION),
    "target_noise": normal(UPDATES, BATCH, ACTION),
    "actor_noise": normal(UPDATES, BATCH, ACTION),
}
closest = math.inf


def network(layers, x, norm):
    global closest
    for weight, bias in zip(layers[:-2:2], layers[1:-2:2]):
        x = x @ weight + bias
        x = F.layer_norm(x, x.shape[-1:], eps=1e-5) if norm else x
        closest = min(closest, x.detach().abs().min().item())
        x = F.relu(x)
    return x @ layers[-2] + layers[-1]


def policy(layers, observation, noise):
    mean, raw = network(layers, observation, False).chunk(2, -1)
    low, high = LOG_STD
    std = (low + 0.5 * (high - low) * (torch.tanh(raw) + 1)).exp()
    u = mean + std * noise
    transform = torch.distributions.TanhTransform()
    action = transform(u)
    log_density = torch.distributions.Normal(mean, std).log_prob(u)
    return action, (log_density - transform.log_abs_det_jacobian(u, action)).sum(-1)


def lower(nets, names, observation, action, norm):
    x = torch.cat([observation, action], -1)
    return torch.minimum(*(network(nets[n], x, norm) for n in names)).squeeze(-1)


def run(norm):
    nets = {name: [x.clone().requires_grad_() for x in layers] for name, layers in FIRST.items()}
    critics, targets = ("critic_1", "critic_2"), ("target_1", "target_2")
    log_alpha = single(torch.tensor([math.log(ALPHA)])).requires_grad_()
    actor_adam = torch.optim.Adam(nets["actor"], lr=ACTOR_RATE)
    critic_adam = torch.optim.Adam(nets["critic_1"] + nets["critic_2"], lr=CRITIC_RATE)
    alpha_adam = torch.optim.Adam([log_alpha], lr=ALPHA_RATE)
    reports = []
    for i in range(UPDATES):
        b = {name: values[i] for name, values in BATCHES.items()}
        alpha = log_alpha.detach().exp()
        with torch.no_grad():
            action, log_p = policy(nets["actor"], b["bootstrap_observation"], b["target_noise"])
            q = lower(nets, targets, b["bootstrap_observation"], action, norm)
            y = b["reward"] + b["discount"] * (q - alpha * log_p)

        x = torch.cat([b["observation"], b["action"]], -1)
        qs = [network(nets[name], x, norm).squeeze(-1) for name in critics]
        critic_loss = sum(0.5 * F.mse_loss(q, y) for q in qs)
        critic_adam.zero_grad()
        critic_loss.backward()
        critic_adam.step()

        action, log_p = policy(nets["actor"], b["observation"], b["actor_noise"])
        q = lower(nets, critics, b["observation"], action, norm)
        actor_loss = (alpha * log_p - q).mean()
        actor_adam.zero_grad()
        actor_loss.backward()
        actor_adam.step()

        alpha_adam.zero_grad()
        (-log_alpha * (log_p.detach() + TARGET_ENTROPY).mean()).sum().backward()
        alpha_adam.step()

        with torch.no_grad():
            for target, critic in zip(targets, critics):
                for t, c in zip(nets[target], nets[critic]):
                    t.mul_(1 - TAU).add_(TAU * c)
        values = [critic_loss, actor_loss, alpha, -log_p.mean(), qs[0].mean(), y.mean()]
        reports.append(torch.stack([v.detach().reshape(()) for v in values]))
    last = {name: flat(layers) for name, layers in nets.items()}
    return last | {"log_alpha": log_alpha.detach(), "reports": torch.stack(reports)}


def flat(layers):
    return torch.cat([x.detach().reshape(-1) for x in layers])


fixture = dict(BATCHES)
for name, layers in FIRST.items():
    fixture[f"first.{name}"] = flat(layers)
for name, norm in (("norm", True), ("bare", False)):
    for key, values in run(norm).items():
        fixture[f"{name}.{key}"] = values
assert closest > 2e-6, f"a pre-activation of {closest}: choose another seed"
path = Path(__file__).with_name("torch.safetensors")
save_file({k: v.float().contiguous() for k, v in fixture.items()}, path)
print(f"torch {torch.__version__}, {path.stat().st_size} bytes, closest pre-activation {closest:.1e}")
