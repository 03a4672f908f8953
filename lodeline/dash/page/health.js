// How each node fares, put together from its own words, its supervisor's, and its promises.

const SILENT_S = 3; // as in lodeline/watch.py
const BUSY = { starting: "starting", ready: "starting", waiting: "waiting", hung: "hung", stopping: "stopping" };
const MARKS = { good: "\u25cf", warn: "\u25b2", bad: "\u2715" };

// {level: good|warn|bad, word, mark, said (its status or undefined), process (or undefined)}
export function healthOf(name, scene, status) {
  const said = status?.nodes[name];
  const process = status?.processes.find((item) => item.nodes.includes(name));
  const [level, word] = judge(name, scene, said, process);
  return { level, word, mark: MARKS[level], said, process };
}

function judge(name, scene, said, process) {
  if (process?.state === "failed") return ["bad", "failed"];
  if (process && BUSY[process.state]) return [process.state === "hung" ? "bad" : "warn", BUSY[process.state]];
  if (process && ["done", "stopped"].includes(process.state)) return ["warn", process.state];
  if (!said) return ["warn", "no word yet"];
  if (said.age > SILENT_S) return ["bad", `silent ${Math.round(said.age)} s`];
  if (said.state === "fault") return ["bad", "fault"];
  if (said.state === "degraded") return ["warn", "degraded"];
  if (slow(scene.nodes[name]?.rates ?? {}, said.rates)) return ["warn", "slow"];
  return ["good", "running"];
}

function slow(promised, rates) {
  return Object.entries(promised).some(([key, rate]) => (rates[key] ?? 0) < 0.8 * rate);
}

// All nodes that are known: of the scene, and of other hosts that speak.
export function nodesOf(scene, status) {
  const names = Object.keys(scene.nodes);
  const others = Object.keys(status?.nodes ?? {}).filter((name) => !scene.nodes[name]);
  return [...names, ...others];
}
