"""Follow the policy beside this file: python policy_example.py. Needs numpy and onnxruntime, nothing else."""

import json
import time
from pathlib import Path

import numpy as np
import onnxruntime

FOLDER, PERIOD_S = Path(__file__).parent, 0.01
options = onnxruntime.SessionOptions()
options.intra_op_num_threads, options.log_severity_level = 1, 3
policy = onnxruntime.InferenceSession(FOLDER / "policy.onnx", options, providers=["CPUExecutionProvider"])
card = json.loads((FOLDER / "policy.json").read_text())
asked = {name: np.array([row], np.float32) for name, row in card["example"]["inputs"].items()}  # a demonstrated start
state, times_s, status = next(iter(asked)), [], 0
for tick in range(round(card["example"]["duration_s"] / PERIOD_S)):
    if "elapsed_s" in asked:
        asked["elapsed_s"][:] = tick * PERIOD_S
    begun = time.perf_counter()
    answer = dict(zip([one.name for one in policy.get_outputs()], policy.run(None, asked), strict=True))
    times_s.append(time.perf_counter() - begun)
    status = max(status, answer["status"][0])  # 0: ok; 1: outside the demonstrated range; 2: no velocity
    asked[state] += PERIOD_S * next(iter(answer.values()))  # a robot moves by itself: here it follows exactly
    if "orientation_wxyz" in asked and state != "position_m":  # joints come first
        asked["position_m"] += PERIOD_S * answer["velocity_m_per_s"]
    if "orientation_wxyz" in asked:  # q̇ = (0, ω) q / 2, with ω in the frame at rest
        (w, *v), half = asked["orientation_wxyz"][0], PERIOD_S * answer["angular_velocity_rad_per_s"][0] / 2
        turned = asked["orientation_wxyz"][0] + np.array([-half @ v, *(half * w + np.cross(half, v))], np.float32)
        asked["orientation_wxyz"][0] = turned / np.linalg.norm(turned)
left = np.abs(asked[state][0] - card["example"]["goal"]).max()
print(f"{1000 * np.median(times_s):.3f} ms a query, worst status {status}, {left:.4f} from the goal at the end")
