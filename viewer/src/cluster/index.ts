/** map3d-cluster: combines markers that are close together. */
export { cluster, type ClusterEvents, type ClusterOptions } from "./cluster";
