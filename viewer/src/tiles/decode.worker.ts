import { decodeTile, transferable, type TileData } from "./tileData";

export interface Task {
  readonly ticket: number;
  readonly kind: string;
  readonly mediaType: string;
  readonly bytes: ArrayBuffer;
}

export type Reply = { readonly ticket: number; readonly data: TileData } | { readonly ticket: number; readonly error: string };

const scope = self as unknown as { onmessage: (event: MessageEvent<Task>) => void; postMessage: (reply: Reply, transfer: Transferable[]) => void };

scope.onmessage = ({ data: { ticket, kind, mediaType, bytes } }) => {
  decodeTile(kind, mediaType, bytes).then(
    (data) => {
      scope.postMessage({ ticket, data }, transferable(data));
      if ("bitmap" in data) data.bitmap.close();
    },
    (reason: unknown) => {
      scope.postMessage({ ticket, error: reason instanceof Error ? reason.message : String(reason) }, []);
    },
  );
};
