import { DecodeError } from "./errors";

/** Inflates a zlib stream to exactly `size` bytes or fails; does not read a longer stream to its end. @throws DecodeError */
export async function inflate(parts: Uint8Array<ArrayBuffer>[], size: number): Promise<Uint8Array<ArrayBuffer>> {
  const out = new Uint8Array(size);
  const reader = new Blob(parts).stream().pipeThrough(new DecompressionStream("deflate")).getReader();
  let at = 0;
  try {
    for (let step = await reader.read(); !step.done; step = await reader.read()) {
      if (at + step.value.length > size) break;
      out.set(step.value, at);
      at += step.value.length;
      if (at === size) at += (await reader.read()).value?.length ?? 0;
    }
  } catch (reason) {
    throw new DecodeError(`the zlib stream is broken: ${String(reason)}`);
  }
  if (at !== size) {
    reader.cancel().catch(() => undefined);
    throw new DecodeError(`the pixel data does not have the ${String(size)} bytes of its header`);
  }
  return out;
}
