#!/usr/bin/env python3
"""The released network: this project, ONNX Runtime and PyTorch in turn, one thread each, on one machine in one run.

    cargo bench -p sabine-estimator --bench against_peers --no-run
    OMP_NUM_THREADS=1 python3 docs/validation/peers/estimator_peers.py

Needs numpy, onnx, onnxruntime and safetensors; PyTorch is left out, and said so, where it is absent. The network is written as
an ONNX graph from the weights file. Prints how far the outputs are apart, clips per second (median, best) at one window and at
64 windows in a call, training clips per second at a batch of 64, and ratios. Rounds alternate, so load falls on all alike.
PROFILE=debug takes a development build instead.
Training: here a whole epoch of the trainer, reading and labels included; in PyTorch the bare steps on tensors in memory.
"""
import glob
import json
import os
import statistics
import subprocess
import tempfile
import time

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper
from safetensors import safe_open

try:
    import torch
except ImportError:
    torch = None

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "..")
WEIGHTS = os.path.join(ROOT, "crates", "estimator", "weights", "room.safetensors")
TARGET = os.environ.get("CARGO_TARGET_DIR", os.path.join(ROOT, "target"))
ROUNDS, BATCH, EPSILON = 5, 64, 1e-5

with safe_open(WEIGHTS, "np") as file:
    config = json.loads(file.metadata()["sabine"])["network"]
    weights = {k.removeprefix("network."): file.get_tensor(k).astype("f4")
               for k in file.keys() if k.startswith("network.")}
assert config["summary"] == "time_mean" and config["spectrum"] and config["hidden"], config
MELS, FRAMES = config["mels"], config["frames"]


def graph():
    """The network as an ONNX model: input [n, 1, mel, frame], output [n, 26]."""
    nodes = []

    def node(kind, inputs, output, **attributes):
        nodes.append(helper.make_node(kind, inputs, [output], **attributes))
        return output

    x = "input"
    for i, block in enumerate(config["blocks"], 1):
        name = f"block{i}"
        x = node("Conv", [x, f"{name}.conv.weight", f"{name}.conv.bias"], f"{name}.c", kernel_shape=block["kernel"])
        x = node("Relu", [x], f"{name}.r")
        x = node("MaxPool", [x], f"{name}.p", kernel_shape=block["pool"], strides=block["pool"])
        x = node("BatchNormalization", [x] + [f"{name}.norm.{part}" for part in
                 ("scale", "shift", "running_mean", "running_variance")], f"{name}.n", epsilon=EPSILON)
    x = node("Flatten", [node("ReduceMean", [x], "mean_time", axes=[3], keepdims=0)], "planes")
    mean = node("ReduceMean", ["input"], "mean", axes=[3], keepdims=1)
    difference = node("Sub", ["input", mean], "difference")
    variance = node("ReduceMean", [node("Mul", [difference, difference], "square")], "variance", axes=[3], keepdims=1)
    mean = node("Flatten", [mean], "mean_flat")
    deviation = node("Flatten", [node("Sqrt", [variance], "deviation")], "deviation_flat")
    x = node("Concat", [x, mean, deviation], "summary", axis=1)
    x = node("Relu", [node("Gemm", [x, "hidden.weight", "hidden.bias"], "hidden", transB=1)], "hidden_relu")
    node("Gemm", [x, "output.weight", "output.bias"], "output", transB=1)
    model = helper.make_model(helper.make_graph(
        nodes, "room", [helper.make_tensor_value_info("input", TensorProto.FLOAT, ["n", 1, MELS, FRAMES])],
        [helper.make_tensor_value_info("output", TensorProto.FLOAT, ["n", config["outputs"]])],
        [numpy_helper.from_array(v, k) for k, v in weights.items()]), opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    onnx.checker.check_model(model)
    return model.SerializeToString()


def times_ms(work, repeats):
    found = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        found.append(1e3 * (time.perf_counter() - start))
    return min(found), statistics.median(found)


def torch_net():
    class Net(torch.nn.Module):
        def __init__(self):
            super().__init__()
            layers, channels = [], 1
            for i, block in enumerate(config["blocks"], 1):
                norm = torch.nn.BatchNorm2d(block["channels"], eps=EPSILON)
                convolution = torch.nn.Conv2d(channels, block["channels"], tuple(block["kernel"]))
                channels = block["channels"]
                for tensor, part in ((convolution.weight, "conv.weight"), (convolution.bias, "conv.bias"),
                                     (norm.weight, "norm.scale"), (norm.bias, "norm.shift"),
                                     (norm.running_mean, "norm.running_mean"),
                                     (norm.running_var, "norm.running_variance")):
                    tensor.data.copy_(torch.from_numpy(weights[f"block{i}.{part}"]))
                layers += [convolution, torch.nn.ReLU(), torch.nn.MaxPool2d(tuple(block["pool"])), norm]
            self.blocks = torch.nn.Sequential(*layers)
            self.dropout = torch.nn.Dropout(config["dropout"])
            for name in ("hidden", "output"):
                dense = torch.nn.Linear(*weights[f"{name}.weight"].shape[::-1])
                dense.weight.data.copy_(torch.from_numpy(weights[f"{name}.weight"]))
                dense.bias.data.copy_(torch.from_numpy(weights[f"{name}.bias"]))
                self.add_module(name, dense)

        def forward(self, x):
            planes = self.blocks(x).mean(3).flatten(1)
            statistics = [x.mean(3).flatten(1), x.std(3, correction=0).flatten(1)]
            x = self.dropout(torch.cat([planes, *statistics], 1))
            return self.output(torch.relu(self.hidden(x)))

    return Net()


def torch_training(inputs):
    """Clips per second of Adam steps with the Gaussian loss."""
    net = torch_net().train()
    adam = torch.optim.AdamW(net.parameters(), lr=2e-3, weight_decay=1e-2)
    labels = torch.randn(BATCH, config["outputs"] // 2)

    def step():
        adam.zero_grad()
        mean, log_variance = net(inputs).chunk(2, 1)
        weight = torch.exp(0.5 * log_variance).detach()
        loss = (weight * 0.5 * (log_variance + (labels - mean) ** 2 * torch.exp(-log_variance))).mean()
        loss.backward()
        adam.step()

    step()
    return 1e3 * BATCH / times_ms(step, 8)[0]


def main():
    programs = glob.glob(os.path.join(TARGET, os.environ.get("PROFILE", "release"), "deps", "against_peers-*"))
    programs = [p for p in programs if "." not in os.path.basename(p) and b"estimator_peers" in open(p, "rb").read()]
    if not programs:
        raise SystemExit("build first: cargo bench -p sabine-estimator --bench against_peers --no-run")
    program = max(programs, key=os.path.getmtime)
    inputs = np.random.default_rng(1).standard_normal((BATCH, 1, MELS, FRAMES)).astype("f4")
    one = np.ascontiguousarray(inputs[:1])
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(graph(), options, providers=["CPUExecutionProvider"])
    if torch:
        torch.set_num_threads(1)
        net = torch_net().eval()
        tensors = torch.from_numpy(inputs)
    times = {}
    training = {"sabine": [], "torch": []}
    environment = dict(os.environ, RAYON_NUM_THREADS="1")
    with tempfile.TemporaryDirectory() as folder:
        paths = [os.path.join(folder, name) for name in ("inputs", "outputs")]
        inputs.tofile(paths[0])
        for _ in range(ROUNDS):
            run = lambda *arguments: subprocess.run(
                [program, *arguments], check=True, capture_output=True, text=True, env=environment).stdout
            for line in run("infer", WEIGHTS, *paths).splitlines():
                name, best, median = line.split()
                times.setdefault(("sabine", name), []).append((float(best), float(median)))
            work = {"one": (one, 400), "all": (inputs, 12)}
            for name, (x, repeats) in work.items():
                times.setdefault(("onnxruntime", name), []).append(
                    times_ms(lambda: session.run(None, {"input": x}), repeats))
                if torch:
                    with torch.inference_mode():
                        t = torch.from_numpy(x)
                        times.setdefault(("torch", name), []).append(times_ms(lambda: net(t), repeats // 2))
            training["sabine"].append(float(run("train").split()[1]))
            if torch:
                training["torch"].append(torch_training(tensors))
        ours = np.fromfile(paths[1], "f4").reshape(BATCH, -1)
    theirs = session.run(None, {"input": inputs})[0]
    print(f"largest difference of outputs: {np.abs(ours - theirs).max():.1e} (ONNX Runtime {onnxruntime.__version__})")
    if torch:
        with torch.inference_mode():
            print(f"largest difference of outputs: {np.abs(ours - net(tensors).numpy()).max():.1e} (PyTorch {torch.__version__})")
    else:
        print("PyTorch is absent: left out")
    speed = {}
    for (who, name), found in times.items():
        clips = {"one": 1, "all": BATCH}[name]
        speed[who, name] = [1e3 * clips / statistics.median(t[1] for t in found), 1e3 * clips / min(t[0] for t in found)]
        print(f"{who}, {clips} in a call: {speed[who, name][0]:.0f} clips/s (median), {speed[who, name][1]:.0f} (best)")
    for (who, name), rates in speed.items():
        if who != "sabine":
            ratios = [a / b for a, b in zip(speed["sabine", name], rates)]
            print(f"sabine / {who}, {name}: {ratios[0]:.2f} (median), {ratios[1]:.2f} (best)")
    for who, found in training.items():
        if found:
            print(f"training, {who}: {statistics.median(found):.0f} clips/s (median), {max(found):.0f} (best)")


if __name__ == "__main__":
    main()
