/** map3d-cluster: markers that lie close together join into one. */
export { cluster, type ClusterEvents, type ClusterOptions } from "./cluster";
