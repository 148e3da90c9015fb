"""Runs an exported policy with NumPy and ONNX Runtime alone: python run_policy.py FOLDER ["reach the red cube"]."""

import json
import re
import sys
import time
from pathlib import Path

import numpy as np
import onnxruntime

if len(sys.argv) < 2:
    sys.exit(__doc__)
folder = Path(sys.argv[1])
if not (folder / "interface.json").is_file():
    sys.exit(f"{folder} holds no interface.json; name a folder that `python -m deixis export` wrote")
options = onnxruntime.SessionOptions()
options.intra_op_num_threads = 1
try:
    interface = json.loads((folder / "interface.json").read_text(encoding="utf-8"))
    if not interface["file"].endswith(".onnx"):
        sys.exit(f"{folder} holds {interface['file']}; this program runs files of format=onnx")
    policy = onnxruntime.InferenceSession(folder / interface["file"], options)
    samples = dict(np.load(folder / "samples.npz"))
    expected = samples.pop("action")
except Exception as error:  # each library has its own types for a missing or damaged file
    sys.exit(f"{folder} lacks a file, or one is damaged; export the policy again ({type(error).__name__}: {error})")


def tokens(sentence):
    """(L,) int64: the input `instruction` of a sentence."""
    words, row = interface["words"], np.zeros(interface["words"]["length"], np.int64)
    found = (word.lower() for word in re.findall(words["pattern"], sentence))
    found = [word.translate(str.maketrans(words["same"])) for word in found if re.match(r"\w", word)]
    ids = {word: number for number, word in enumerate(words["vocabulary"])}
    if not found:
        sys.exit("the sentence has no words")
    if len(found) > len(row):
        sys.exit(f"the sentence has {len(found)} words; this policy reads at most {len(row)}")
    if unknown := [word for word in found if word not in ids]:
        print("words that this policy does not know:", ", ".join(unknown))
    row[: len(found)] = [ids.get(word, ids["<unk>"]) for word in found]
    return row


print("greatest difference from the samples:", np.abs(policy.run(None, samples)[0] - expected).max())

now = {name: values[:1] for name, values in samples.items()}  # one scene
if len(sys.argv) > 2:
    now["instruction"] = tokens(" ".join(sys.argv[2:]))[None]
begin = time.perf_counter()
(action,) = policy.run(None, now)
print("action:", action[0].round(4).tolist(), f"in {1000 * (time.perf_counter() - begin):.2f} ms")
