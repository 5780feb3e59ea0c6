// Moves the view of a shared link from the query, which servers see, to the fragment, which the viewer reads. Runs before the viewer.
"use strict";
(() => {
  const url = new URL(location.href);
  const view = url.searchParams.get("view");
  if (view === null) return;
  url.searchParams.delete("view");
  if (url.hash === "") url.hash = view;
  history.replaceState(history.state, "", url);
})();
