import { execFileSync } from "node:child_process";
import { mkdirSync, mkdtempSync, renameSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";

export const VIEWER = resolve(import.meta.dirname, "../..");

/** A folder with the packed package in its node_modules, as installed from a registry. */
export class Installation {
  readonly folder = mkdtempSync(join(tmpdir(), "map3d-package-"));
  /** Paths in the package, sorted. */
  readonly files: readonly string[];

  constructor(sources: Readonly<Record<string, string>>) {
    const [packed] = JSON.parse(execFileSync("npm", ["pack", "--json", "--ignore-scripts", "--pack-destination", this.folder], { cwd: VIEWER, encoding: "utf8", stdio: ["ignore", "pipe", "ignore"] })) as [{ filename: string; files: { path: string }[] }];
    this.files = packed.files.map(({ path }) => path).sort();
    mkdirSync(join(this.folder, "node_modules"));
    execFileSync("tar", ["-xzf", packed.filename], { cwd: this.folder });
    renameSync(join(this.folder, "package"), join(this.folder, "node_modules/map3d"));
    for (const [name, text] of Object.entries(sources)) writeFileSync(join(this.folder, name), text);
  }

  path(name: string): string {
    return join(this.folder, name);
  }

  remove(): void {
    rmSync(this.folder, { recursive: true });
  }
}
