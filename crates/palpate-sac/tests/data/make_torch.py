"""Twenty updates of soft actor-critic in PyTorch, in float64, for golden.rs.

    pip install torch numpy && python make_torch.py

Writes torch.safetensors beside this file: first weights, batches with their noise, last weights. The networks,
the density and the optimiser are PyTorch's own; only the flat order of the weights is ours.
"""

import json
import pathlib
import struct

import numpy as np
import torch
from torch import nn
from torch.distributions import Normal, TanhTransform

OBSERVATION, ACTION, HIDDEN, BATCH, UPDATES = 5, 3, (16, 16), 8, 20
RATE, TAU, ALPHA, TARGET_ENTROPY, LOG_STD = 1e-3, 0.05, 0.1, -1.5, (-5.0, 2.0)

torch.set_default_dtype(torch.float64)
torch.set_num_threads(1)


def network(inputs, outputs, layer_norm):
    layers, width = [], inputs
    for units in HIDDEN:
        layers.append(nn.Linear(width, units))
        if layer_norm:
            layers.append(nn.LayerNorm(units, elementwise_affine=False))
        layers.append(nn.ReLU())
        width = units
    return nn.Sequential(*layers, nn.Linear(width, outputs))


def flat(net):
    """W1 (in, out) row-major, b1, W2, …"""
    parts = []
    for layer in net:
        if isinstance(layer, nn.Linear):
            parts += [layer.weight.detach().T.reshape(-1), layer.bias.detach()]
    return torch.cat(parts)


def act(actor, observation, noise):
    mean, raw = actor(observation).chunk(2, dim=1)
    low, high = LOG_STD
    std = torch.exp(low + 0.5 * (high - low) * (torch.tanh(raw) + 1))
    u = mean + std * noise
    log_density = Normal(mean, std).log_prob(u).sum(1)
    transform = TanhTransform()
    action = transform(u)
    return action, log_density - transform.log_abs_det_jacobian(u, action).sum(1)


def run(layer_norm, actor, critics, batches):
    targets = [network(OBSERVATION + ACTION, 1, layer_norm) for _ in critics]
    for target, critic in zip(targets, critics):
        target.load_state_dict(critic.state_dict())
    log_alpha = torch.tensor([np.log(ALPHA)], requires_grad=True)
    adam = lambda parameters: torch.optim.Adam(parameters, lr=RATE)
    actor_adam, alpha_adam = adam(actor.parameters()), adam([log_alpha])
    critic_adam = adam([p for critic in critics for p in critic.parameters()])
    value = lambda nets, o, a: torch.minimum(*[net(torch.cat([o, a], 1)).squeeze(1) for net in nets])
    for b in batches:
        alpha = log_alpha.detach().exp()
        with torch.no_grad():
            action, log_density = act(actor, b["bootstrap"], b["target_noise"])
            y = b["reward"] + b["discount"] * (value(targets, b["bootstrap"], action) - alpha * log_density)
        inputs = torch.cat([b["observation"], b["action"]], 1)
        loss = sum(0.5 * ((critic(inputs).squeeze(1) - y) ** 2).mean() for critic in critics)
        critic_adam.zero_grad()
        loss.backward()
        critic_adam.step()

        action, log_density = act(actor, b["observation"], b["actor_noise"])
        loss = (alpha * log_density - value(critics, b["observation"], action)).mean()
        actor_adam.zero_grad()
        loss.backward()
        actor_adam.step()

        loss = -(log_alpha * (log_density.detach().mean() + TARGET_ENTROPY)).sum()
        alpha_adam.zero_grad()
        loss.backward()
        alpha_adam.step()

        with torch.no_grad():
            for target, critic in zip(targets, critics):
                for t, c in zip(target.parameters(), critic.parameters()):
                    t += TAU * (c - t)
    return {
        "actor": flat(actor),
        "critic_0": flat(critics[0]),
        "critic_1": flat(critics[1]),
        "target_0": flat(targets[0]),
        "target_1": flat(targets[1]),
        "log_alpha": log_alpha.detach(),
    }


def main():
    generator = torch.Generator().manual_seed(7)
    normal = lambda *shape: torch.randn(*shape, generator=generator).float().double()
    batches = []
    for _ in range(UPDATES):
        steps = torch.randint(1, 6, (BATCH,), generator=generator)
        terminal = torch.rand(BATCH, generator=generator) < 0.2
        batches.append({
            "observation": normal(BATCH, OBSERVATION),
            "action": torch.tanh(normal(BATCH, ACTION)).float().double(),
            "reward": normal(BATCH),
            # γ^steps of n-step returns of unlike length, 0 after a terminal step.
            "discount": torch.where(terminal, 0.0, 0.98**steps).float().double(),
            "bootstrap": normal(BATCH, OBSERVATION),
            "target_noise": normal(BATCH, ACTION),
            "actor_noise": normal(BATCH, ACTION),
        })
    tensors = {name: torch.stack([b[name] for b in batches]) for name in batches[0]}
    for layer_norm in (False, True):
        torch.manual_seed(11)
        actor = network(OBSERVATION, 2 * ACTION, False)
        critics = [network(OBSERVATION + ACTION, 1, layer_norm) for _ in range(2)]
        for net in (actor, *critics):
            for p in net.parameters():
                p.data = p.data.float().double()
        prefix = "norm." if layer_norm else "plain."
        for name, net in (("actor", actor), ("critic_0", critics[0]), ("critic_1", critics[1])):
            tensors[f"{prefix}first.{name}"] = flat(net)
        for name, values in run(layer_norm, actor, critics, batches).items():
            tensors[f"{prefix}last.{name}"] = values
    write(pathlib.Path(__file__).with_name("torch.safetensors"), tensors)


def write(path, tensors):
    header, body = {"__metadata__": {"torch": torch.__version__}}, b""
    for name, values in tensors.items():
        data = values.numpy().astype("<f4").tobytes()
        header[name] = {"dtype": "F32", "shape": list(values.shape), "data_offsets": [len(body), len(body) + len(data)]}
        body += data
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    path.write_bytes(struct.pack("<Q", len(text)) + text + body)


if __name__ == "__main__":
    main()
