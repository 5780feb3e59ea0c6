import { decodeData, type DataRequest, type DataResponse } from "./decodeData";

const scope = self as unknown as {
  onmessage: (event: MessageEvent<DataRequest>) => void;
  postMessage: (response: DataResponse, transfer: Transferable[]) => void;
};

scope.onmessage = ({ data: request }) => {
  decodeData(request).then(
    (data) => {
      scope.postMessage({ id: request.id, data }, "values" in data ? [data.values.buffer] : []);
    },
    (reason: unknown) => {
      scope.postMessage({ id: request.id, error: reason instanceof Error ? reason.message : String(reason) }, []);
    },
  );
};
