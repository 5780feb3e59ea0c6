import type { DecodeRequest, DecodeResponse } from "./decodeMessages";
import { decodeTile, listTransferables } from "./tileData";

const scope = self as unknown as {
  onmessage: (event: MessageEvent<DecodeRequest>) => void;
  postMessage: (response: DecodeResponse, transfer: Transferable[]) => void;
};

scope.onmessage = ({ data: { id, kind, mediaType, bytes, below } }) => {
  decodeTile(kind, mediaType, bytes, below).then(
    (data) => {
      scope.postMessage({ id, data }, listTransferables(data));
      if ("bitmap" in data) data.bitmap.close();
    },
    (reason: unknown) => {
      scope.postMessage({ id, error: reason instanceof Error ? reason.message : String(reason) }, []);
    },
  );
};
