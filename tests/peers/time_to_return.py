#!/usr/bin/env python3
"""How long dbr and Stable-Baselines3's SAC take until they walk, on the same machine, one after the other.

Wall-clock seconds from the start of the command until the mean of five evaluations in a row reaches a
return. Both evaluate every 2,000 steps, five episodes with the policy's most probable action, and pay for it:
Stable-Baselines3 between its steps, dbr in a process of its own beside them. Both have two hidden layers of
the same width, batches of 256 and one update for each step.

    python3 -m venv v && v/bin/pip install torch stable-baselines3 pybullet "setuptools<80"
    v/bin/python tests/peers/time_to_return.py --env hopper --seeds 1 2 3

Prints one line for each run and writes all figures to --out (JSON).
"""

import argparse
import collections
import json
import pathlib
import subprocess
import sys
import time
import types

ROBOTS = {
    "hopper": ("HopperBulletEnv", 1000.0),
    "half_cheetah": ("HalfCheetahBulletEnv", 600.0),
    "walker2d": ("Walker2DBulletEnv", 600.0),
    "ant": ("AntBulletEnv", 600.0),
}
EVERY_STEPS = 2000
EPISODES = 5
IN_A_ROW = 5
TIME_LIMIT = 1000  # steps of an episode


class Progress:
    """The evaluations of one run, and when the mean of the newest five reached the target."""

    def __init__(self, target):
        self.target = target
        self.curve = []  # [seconds, steps, mean return]
        self.reached = None  # seconds

    def add(self, seconds, steps, value):
        self.curve.append([round(seconds, 2), steps, round(value, 1)])
        newest = [point[2] for point in self.curve[-IN_A_ROW:]]
        if self.reached is None and len(newest) == IN_A_ROW and sum(newest) / IN_A_ROW >= self.target:
            self.reached = seconds


def bullet_env(name):
    """One of PyBullet's robots as a Gymnasium environment. pybullet_envs asks for the older package gym."""
    import gymnasium
    import numpy

    class Registry:
        env_specs = {}

    gym = types.ModuleType("gym")
    gym.__version__ = "0.21.0"
    gym.Env = gymnasium.Env
    gym.spaces = gymnasium.spaces
    gym.utils = types.ModuleType("gym.utils")
    gym.utils.seeding = types.ModuleType("gym.utils.seeding")
    gym.utils.seeding.np_random = lambda seed=None: (numpy.random.RandomState(seed), seed)
    gym.envs = types.ModuleType("gym.envs")
    gym.envs.registration = types.ModuleType("gym.envs.registration")
    gym.envs.registration.registry = Registry()
    gym.envs.registration.register = lambda *_, **__: None
    gym.envs.registration.make = gym.envs.registration.spec = None
    sys.modules["gym.spaces"] = gymnasium.spaces
    for module in (gym, gym.utils, gym.utils.seeding, gym.envs, gym.envs.registration):
        sys.modules[module.__name__] = module
    from pybullet_envs import gym_locomotion_envs

    robot = getattr(gym_locomotion_envs, name)()
    box = gymnasium.spaces.Box

    class Env(gymnasium.Env):
        observation_space = box(-numpy.inf, numpy.inf, robot.observation_space.shape, numpy.float32)
        action_space = box(-1, 1, robot.action_space.shape, numpy.float32)

        def reset(self, seed=None, options=None):
            if seed is not None:
                robot.seed(seed)
            self.steps = 0
            return numpy.asarray(robot.reset(), numpy.float32), {}

        def step(self, action):
            observation, reward, ended, info = robot.step(action)
            self.steps += 1
            cut = self.steps >= TIME_LIMIT and not ended
            return numpy.asarray(observation, numpy.float32), float(reward), bool(ended), cut, info

    return Env()


def run_sb3(env, seed, width, target, max_steps):
    """Trains in this process; returns the Progress."""
    started = time.monotonic()
    from stable_baselines3 import SAC
    from stable_baselines3.common.callbacks import BaseCallback

    evaluation_env = bullet_env(ROBOTS[env][0])
    progress = Progress(target)

    class Evaluate(BaseCallback):
        def _on_step(self):
            if self.num_timesteps % EVERY_STEPS != 0:
                return True
            total = 0.0
            for _ in range(EPISODES):
                observation, _ = evaluation_env.reset()
                done = False
                while not done:
                    action, _ = self.model.predict(observation, deterministic=True)
                    observation, reward, ended, cut, _ = evaluation_env.step(action)
                    total += reward
                    done = ended or cut
            progress.add(time.monotonic() - started, self.num_timesteps, total / EPISODES)
            return progress.reached is None

    model = SAC("MlpPolicy", bullet_env(ROBOTS[env][0]), policy_kwargs={"net_arch": [width, width]},
                batch_size=256, learning_starts=1000, device="cpu", seed=seed)
    model.learn(max_steps, callback=Evaluate())
    return progress


def run_dbr(program, folder, env, seed, width, target, max_steps):
    """Launches a run and reads its metrics; ends it when the target is reached. Returns the Progress."""
    config = pathlib.Path(__file__).resolve().parents[2] / "deploy" / "configs" / f"{env}.textproto"
    settings = [f"network.hidden_sizes=[{width},{width}]", f"launch.max_steps={max_steps}",
                f"evaluation.every_updates={EVERY_STEPS}", f"evaluation.episodes={EPISODES}",
                f"evaluation.final_episodes={EPISODES}"]
    command = [program, "launch", str(config), "--seed", str(seed), "--run-dir", str(folder)]
    for setting in settings:
        command += ["--set", setting]
    progress = Progress(target)
    started, epoch = time.monotonic(), time.time()
    run = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    metrics, lines = folder / "metrics.jsonl", 0
    while True:
        ended = run.poll() is not None
        rows = metrics.read_text().splitlines() if metrics.exists() else []
        for row in rows[lines:]:
            values = json.loads(row)
            if "eval/mean_reward" in values and values["step"] > 0:
                progress.add(values["wall_time"] - epoch, int(values["step"]), values["eval/mean_reward"])
        lines = len(rows)
        if ended or progress.reached is not None:
            break
        time.sleep(0.2)
    run.send_signal(2)
    run.wait()
    return progress


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", choices=sorted(ROBOTS), default="hopper")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--width", type=int, default=128, help="units of each of the two hidden layers")
    parser.add_argument("--max-steps", type=int, default=100000, help="a run that is slower has no time")
    parser.add_argument("--program", default="build/bin/dbr")
    parser.add_argument("--runs", type=pathlib.Path, default=pathlib.Path("runs/time_to_return"))
    parser.add_argument("--out", type=pathlib.Path, default=None)
    parser.add_argument("--only", choices=["dbr", "sb3"], default=None)
    arguments = parser.parse_args()
    target = ROBOTS[arguments.env][1]
    results = collections.defaultdict(dict)
    for seed in arguments.seeds:
        if arguments.only != "sb3":
            folder = arguments.runs / f"{arguments.env}-{seed}"
            progress = run_dbr(arguments.program, folder, arguments.env, seed, arguments.width, target,
                               arguments.max_steps)
            results["dbr"][seed] = {"seconds": progress.reached, "curve": progress.curve}
            print(f"dbr {arguments.env} seed {seed}: {progress.reached} s", flush=True)
        if arguments.only != "dbr":
            progress = run_sb3(arguments.env, seed, arguments.width, target, arguments.max_steps)
            results["stable_baselines3"][seed] = {"seconds": progress.reached, "curve": progress.curve}
            print(f"stable-baselines3 {arguments.env} seed {seed}: {progress.reached} s", flush=True)
    if arguments.out is not None:
        arguments.out.write_text(json.dumps({"env": arguments.env, "target": target, "runs": results}, indent=1))


if __name__ == "__main__":
    main()
