import { spawn, type ChildProcess, type SpawnOptions } from "node:child_process";

/** Starts a program and reads its output until it matches. @param fd the output: 1, 2, or another one  @throws Error when it ends before, or after 30 seconds */
export async function startUntil(
  program: string,
  args: readonly string[],
  env: Record<string, string>,
  fd: 1 | 2 | 3,
  text: RegExp,
): Promise<{ child: ChildProcess; found: string }> {
  const stdio: SpawnOptions["stdio"] = [0, 1, 2, 3].map((other) => (other === fd ? "pipe" : "ignore"));
  const child = spawn(program, args, { stdio, env: { ...process.env, ...env } });
  const found = await new Promise<string>((done, fail) => {
    let output = "";
    const late = setTimeout(() => {
      fail(new Error(`${program} did not start in 30 seconds; output: ${output}`));
    }, 30_000);
    child.stdio[fd]?.on("data", (bytes: Buffer) => {
      output += bytes.toString();
      const match = text.exec(output)?.[1];
      if (match === undefined) return;
      clearTimeout(late);
      done(match);
    });
    child.once("error", fail).once("exit", (code) => {
      fail(new Error(`${program} ended with ${String(code)}; output: ${output}`));
    });
  });
  return { child, found };
}

export async function stop(child: ChildProcess): Promise<void> {
  if (child.exitCode !== null || child.signalCode !== null) return;
  const gone = new Promise((done) => child.once("exit", done));
  child.kill();
  const late = setTimeout(() => child.kill("SIGKILL"), 5000);
  await gone;
  clearTimeout(late);
}

/** A virtual screen. */
export class Display {
  private constructor(
    readonly name: string,
    private readonly child: ChildProcess,
  ) {}

  static async open(): Promise<Display> {
    const { child, found } = await startUntil(
      "Xvfb",
      ["-displayfd", "3", "-screen", "0", "1024x768x24", "-nolisten", "tcp"],
      {},
      3,
      /^(\d+)\n/,
    );
    return new Display(`:${found}`, child);
  }

  close(): Promise<void> {
    return stop(this.child);
  }
}
