// Uploads a file with tus-js-client, breaks off once, and resumes in a new upload. Arguments: the package's folder, a JSON document with url, token, file, name,
// pieceBytes: of a PATCH, 0 for one of the whole file, breakAt: bytes after which the connection is broken. Prints what the client saw as JSON.
import { createReadStream, statSync } from "node:fs";
import { createRequire } from "node:module";
import { Readable } from "node:stream";

const [folder, asked] = process.argv.slice(2);
const { Upload } = createRequire(import.meta.url)(folder);
const { url, token, file, pieceBytes, breakAt, name } = JSON.parse(asked);
const seen = { statuses: [] };

/** Returns the file's first bytes as a stream that then waits, so that no piece which is broken off can be complete. */
function stalled() {
  return Readable.from((async function* () {
    for await (const part of createReadStream(file, { end: breakAt + (1 << 20) })) yield part;
    await new Promise(() => undefined);
  })());
}

function upload(source, more) {
  return new Promise((done, failed) => {
    const made = new Upload(source, {
      endpoint: url,
      headers: { Authorization: `Bearer ${token}` },
      metadata: { filename: name },
      uploadSize: statSync(file).size,
      chunkSize: pieceBytes || statSync(file).size,
      retryDelays: null,
      onAfterResponse: (request, response) => { seen.statuses.push(`${request.getMethod()} ${response.getStatus()}`); },
      onSuccess: () => { done(made); },
      onError: failed,
      ...more({ done, upload: () => made }),
    });
    made.start();
  });
}

let broken = 0;
const first = await upload(stalled(), ({ done, upload: made }) => ({
  onProgress: (sent) => {
    if (sent < breakAt || broken > 0) return;
    broken = sent;
    made().abort().then(() => { done(made()); });
  },
}));
const again = await upload(createReadStream(file), () => ({ uploadUrl: first.url }));
console.log(JSON.stringify({ ...seen, broken, url: again.url }));
