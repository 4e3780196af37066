# SPDX-License-Identifier: GPL-3.0-or-later
"""The published neural law on the CPU as PyTorch runs it: singular values, thirteen invariants, two
nets 13 → 64 → 64 → 9 without biases, exact GELU, gradients by autograd. Random weights. Run by
bench_others.py; the lines are those of neural_bench.
"""

import json
import statistics
import sys
import time

import torch

THREADS = int(sys.argv[1])
FLOW = 1e-3
STRAIN = 0.1
torch.set_num_threads(THREADS)
torch.manual_seed(1)


def net():
    layers = [torch.nn.Linear(a, b, bias=False) for a, b in ((13, 64), (64, 64), (64, 9))]
    gelu = torch.nn.GELU()
    return torch.nn.Sequential(layers[0], gelu, layers[1], gelu, layers[2])


def features(f):
    u, s, vh = torch.linalg.svd(f)
    stretch = s - 1.0
    cauchy = (f.mT @ f - torch.eye(3)).flatten(1)
    return u @ vh, torch.cat([stretch, cauchy, torch.linalg.det(f)[:, None] - 1.0], 1)


def symmetric(y):
    x = y.view(-1, 3, 3)
    return 0.5 * (x + x.mT)


class Law(torch.nn.Module):
    def __init__(self):
        super().__init__()
        self.plastic = net()
        self.elastic = net()

    def forward(self, trial):
        rotation, entering = features(trial)
        f = trial + FLOW * (rotation @ symmetric(self.plastic(entering)))
        rotation, entering = features(f)
        return f, rotation @ symmetric(self.elastic(entering)) @ f.mT


class Nets(torch.nn.Module):
    """The two nets alone, fed with what they are fed with."""

    def __init__(self):
        super().__init__()
        self.plastic = net()
        self.elastic = net()

    def forward(self, entering):
        return self.plastic(entering), self.elastic(entering)


def rate(points, work, repetitions=5, seconds=0.5):
    work()
    rates = []
    for _ in range(repetitions):
        done, took, start = 0, 0.0, time.perf_counter()
        while took < seconds:
            work()
            done += points
            took = time.perf_counter() - start
        rates.append(done / took * 1e-6)
    return statistics.median(rates)


def measure(name, module, given):
    points = len(given)
    wanted = given.clone().requires_grad_(True)
    bars = [torch.rand_like(part) - 0.5 for part in module(given)]

    def forward():
        with torch.no_grad():
            module(given)

    def both():
        module.zero_grad(set_to_none=True)
        wanted.grad = None
        torch.autograd.backward(module(wanted), bars)

    ahead, back = rate(points, forward), rate(points, both)
    line = {
        "name": "neural",
        "law": name,
        "points": points,
        "threads": THREADS,
        "forward_mps": round(ahead, 3),
        "forward_backward_mps": round(back, 3),
        "forward_ms": round(points / ahead * 1e-3, 3),
    }
    print(json.dumps(line), flush=True)


for count in (1_000, 100_000):
    deformations = torch.eye(3) + STRAIN * (2.0 * torch.rand(count, 3, 3) - 1.0)
    measure("published, PyTorch", Law(), deformations)
    measure("published, PyTorch, its two nets alone", Nets(), features(deformations)[1])
