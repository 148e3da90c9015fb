"""`deixis export`: files of a policy for programs without Deixis."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch

import deixis
from core.errors import ConfigError
from core.overrides import compose
from deixis.export import main
from tests.helpers.shared_runs import made_once
from tests.helpers.tiny_run import TINY
from trainers.config import read_policy
from trainers.export.exported_policy import ExportedPolicy
from trainers.models.grounding import GroundingEncoder
from trainers.models.policy import build_networks

ROOT = Path(__file__).resolve().parents[2]
SAME = 1e-5  # of an action


def export(folder, name, form, *more):
    return main([f"checkpoint={name}", f"format={form}", "samples=60", f"out={folder}", *more])


@pytest.fixture(scope="session")
def onnx_folder(tmp_path_factory):
    return made_once(tmp_path_factory, "export-onnx", lambda folder: export(folder, "anything_kuka", "onnx"))


def samples_of(folder):
    samples = dict(np.load(folder / "samples.npz"))
    return samples, samples.pop("action")


def interface_of(folder):
    return json.loads((folder / "interface.json").read_text(encoding="utf-8"))


@pytest.mark.slow
def test_onnx_gives_the_same_actions_for_any_number_of_worlds(onnx_folder):
    samples, action = samples_of(onnx_folder)
    session = onnxruntime.InferenceSession(onnx_folder / "policy.onnx")
    for rows in (1, 7, 60):
        some = {name: values[:rows] for name, values in samples.items()}
        assert np.abs(session.run(None, some)[0] - action[:rows]).max() < SAME
    assert np.ptp(action, axis=0).min() > 0.1  # the samples differ


@pytest.mark.slow
def test_onnx_takes_another_number_of_objects(onnx_folder):
    samples, _ = samples_of(onnx_folder)
    rows = {name: values[:, :9] for name, values in samples.items() if name.startswith("objects")}
    session = onnxruntime.InferenceSession(onnx_folder / "policy.onnx")
    assert session.run(None, samples | rows)[0].shape == (60, 4)


@pytest.mark.slow
def test_the_example_runs_the_file_without_torch_and_deixis(onnx_folder, tmp_path):
    code = (
        "import runpy, sys; runpy.run_path(sys.argv.pop(1)); "
        "assert not {'torch', 'deixis', 'language'} & set(sys.modules)"
    )
    words = [sys.executable, "-c", code, ROOT / "examples/run_policy.py", onnx_folder, "press the red button"]
    done = subprocess.run(words, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 0, done.stderr
    first, second = done.stdout.splitlines()
    assert float(first.rpartition(" ")[2]) < SAME
    assert second.startswith("action: [")


def run_example(*words):
    program = [sys.executable, ROOT / "examples/run_policy.py", *words]
    return subprocess.run(program, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_the_example_names_the_words_that_a_policy_does_not_know(onnx_folder):
    done = run_example(onnx_folder, "reach the blurple cube")
    assert done.returncode == 0, done.stderr
    assert "does not know: blurple" in done.stdout


@pytest.mark.slow
def test_the_example_refuses_a_sentence_that_is_too_long(onnx_folder):
    done = run_example(onnx_folder, "red " * 200)
    assert done.returncode == 1
    assert done.stderr.startswith("the sentence has 200 words")
    assert "Traceback" not in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "content"),
    [("samples.npz", None), ("interface.json", "[]"), ("interface.json", "{"), ("policy.onnx", "x")],
)
def test_the_example_says_that_a_file_is_missing_or_damaged(onnx_folder, tmp_path, name, content):
    folder = shutil.copytree(onnx_folder, tmp_path / "policy")
    (folder / name).unlink()
    if content is not None:
        (folder / name).write_text(content)
    done = run_example(folder, "reach the red cube")
    assert done.returncode == 1
    assert "lacks a file, or one is damaged" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_the_example_refuses_a_sentence_without_words(onnx_folder):
    done = run_example(onnx_folder, "")
    assert done.returncode == 1
    assert done.stderr.strip() == "the sentence has no words"


def test_the_example_names_a_folder_that_holds_no_policy(tmp_path):
    pytest.importorskip("onnxruntime")
    done = run_example(tmp_path / "none")
    assert done.returncode == 1
    assert "none holds no interface.json" in done.stderr


@pytest.mark.slow
def test_the_interface_describes_inputs_words_robot_and_control(onnx_folder):
    interface, (samples, action) = interface_of(onnx_folder), samples_of(onnx_folder)
    assert [each["name"] for each in interface["inputs"]] == list(samples)
    for each in interface["inputs"]:
        values = samples[each["name"]]
        assert each["shape"][1:] == list(values.shape[1:])
        assert each["dtype"] == str(values.dtype)
        assert each["description"]
        if "low" in each:
            assert (values >= np.array(each["low"], np.float32)).all()
            assert (values <= np.array(each["high"], np.float32)).all()
        if "columns" in each:
            assert len(each["columns"]) == values.shape[-1] == len(set(each["columns"]))
    assert interface["output"]["shape"] == ["rows", action.shape[1]]
    assert interface["robot"]["joints"][0] == "lbr_iiwa_joint_1"
    assert len(interface["robot"]["low"]) == len(interface["robot"]["rest"]) == 7
    assert interface["control"]["hz"] == pytest.approx(20)
    assert interface["control"]["gripper"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "sentence", ["reach the red cube", "Reach the  blurple cube, it\u2019s LEFT!", "é-2 isn't; a_b"]
)
def test_the_rule_of_the_interface_gives_the_tokens_of_the_project(onnx_folder, sentence):
    source = (ROOT / "examples/run_policy.py").read_text(encoding="utf-8")
    function = source[source.index("def tokens") : source.index('print("greatest')]
    scope = {"interface": interface_of(onnx_folder), "np": np, "re": __import__("re")}
    exec(function, scope)
    policy = deixis.load_policy("anything_kuka")
    env = policy.make_env()
    try:
        assert scope["tokens"](sentence).tolist() == env.tokenizer.encode(sentence).tolist()
    finally:
        env.close()


@pytest.mark.slow
def test_torchscript_gives_the_same_actions(tmp_path):
    folder = export(tmp_path / "it", "nl_reach_gesture_kuka", "torchscript")
    samples, action = samples_of(folder)
    script = torch.jit.load(str(folder / "policy.ts"))
    some = [torch.from_numpy(values[:13]) for values in samples.values()]
    assert np.abs(script(*some).detach().numpy() - action[:13]).max() < SAME


@pytest.mark.slow
def test_safetensors_is_a_checkpoint_again(tmp_path):
    folder = export(tmp_path / "it", "nl_reach_kuka", "safetensors")
    samples, action = samples_of(folder)
    again = deixis.load_policy(folder)
    with torch.no_grad():
        out = ExportedPolicy(again.networks)(*(torch.from_numpy(values) for values in samples.values()))
    assert torch.equal(out, torch.from_numpy(action))


@pytest.mark.slow
def test_a_run_without_attention_is_exported(tiny_mlp_run, tmp_path):
    folder = export(tmp_path / "it", tiny_mlp_run, "onnx")
    samples, action = samples_of(folder)
    session = onnxruntime.InferenceSession(folder / "policy.onnx")
    assert np.abs(session.run(None, samples)[0] - action).max() < SAME


@pytest.fixture(scope="session")
def tiny_mlp_run(tmp_path_factory):
    import train

    config = compose([*TINY, "policy=mlp"])
    return made_once(tmp_path_factory, "export-mlp", lambda folder: train.run(config, folder))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "checkpoint=<run dir, file or name> is missing"),
        (["checkpoint=nl_reach_kuca"], "did you mean 'nl_reach_kuka'"),
        (["checkpoint=nl_reach_kuka", "format=onx"], "format=onx is not known"),
        (["checkpoint=nl_reach_kuka", "samples=1"], "samples=1 is out of range"),
        (["checkpoint=nl_reach_kuka", "robot=panda"], "was trained with robot=kuka"),
        (["checkpoint=nl_reach_kuka", "out=/proc/it"], "out=/proc/it cannot be a folder"),
    ],
)
def test_bad_words_are_refused_in_one_sentence(words, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match=message):
        main(words)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_exists_is_not_overwritten(tmp_path):
    with pytest.raises(ConfigError, match="exists already"):
        main(["checkpoint=nl_reach_kuka", f"out={tmp_path}"])


def test_a_missing_library_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxscript", None)
    with pytest.raises(ConfigError, match=r'ONNX files need onnxscript.*pip install -e "\.\[export\]"'):
        export(tmp_path / "it", "nl_reach_kuka", "onnx")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_policy_that_torch_cannot_express_is_refused(tmp_path, monkeypatch):
    def branches(self, tokens):
        return self.query_encoder.encode(tokens) * (1.0 if int(tokens.sum()) % 2 else 2.0)

    monkeypatch.setattr(GroundingEncoder, "encode_all_words", branches)
    with pytest.raises(ConfigError, match="format=onnx: torch cannot express this policy"):
        export(tmp_path / "it", "nl_reach_kuka", "onnx")
    assert not list(tmp_path.iterdir())


def test_a_frozen_sentence_encoder_is_refused():
    pytest.importorskip("transformers")
    policy = deixis.load_policy("nl_reach_kuka")
    env = policy.make_env()
    try:
        config = read_policy(policy.config["policy"] | {"encoder": "sentence"})
        built = build_networks(config, env.observation_spec, env.action_unit, vocabulary=env.tokenizer.vocabulary)
    finally:
        env.close()
    with pytest.raises(ConfigError, match=r"policy\.encoder=sentence cannot be exported"):
        ExportedPolicy(built)
