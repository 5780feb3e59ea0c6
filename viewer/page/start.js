/* Says why the map cannot open, in the reader's language over the preview picture: from a folder on disk, in a browser that is too old, or if page.js is refused.
   It runs in every browser with JavaScript, so it is ECMAScript 5, and a script rather than a module: browsers open no modules from disk. Deferred: the document is
   complete, and no module has run. */
(function () {
  "use strict";
  var MESSAGES = {
    en: {
      file: "Browsers can’t open this map from a folder on disk. Copy the folder to a web server and open it from there. README.txt has the details.",
      old: "This browser is too old for this map. Use Chrome or Edge 111, Firefox 121, Safari 16.4 or a newer version.",
      refused: "This map’s script didn’t load. Reload the page. If that doesn’t help, the web server doesn’t send .js files as JavaScript.",
    },
    de: {
      file: "Browser können diese Karte nicht aus einem Ordner auf der Festplatte öffnen. Kopieren Sie den Ordner auf einen Webserver und öffnen Sie die Karte von dort. README.txt sagt, wie.",
      old: "Dieser Browser ist zu alt für diese Karte. Verwenden Sie Chrome oder Edge 111, Firefox 121, Safari 16.4 oder neuer.",
      refused:
        "Das Skript dieser Karte wurde nicht geladen. Laden Sie die Seite neu. Hilft das nicht, sendet der Webserver .js-Dateien nicht als JavaScript.",
    },
    fr: {
      file: "Les navigateurs ne peuvent pas ouvrir cette carte depuis un dossier du disque. Copiez le dossier sur un serveur web et ouvrez-la de là. Voir README.txt.",
      old: "Ce navigateur est trop ancien pour cette carte. Utilisez Chrome ou Edge 111, Firefox 121, Safari 16.4 ou une version plus récente.",
      refused:
        "Le script de cette carte n’a pas été chargé. Rechargez la page. Si cela ne suffit pas, le serveur web n’envoie pas les fichiers .js comme JavaScript.",
    },
  };
  var NEEDED = ["DecompressionStream", "ResizeObserver", "Worker", "AbortController", "structuredClone"];
  var languages = navigator.languages || [navigator.language || "en"];
  var isFile = location.protocol === "file:";
  var shown = false;

  function texts() {
    for (var k = 0; k < languages.length; k++) {
      var language = languages[k].slice(0, 2).toLowerCase();
      if (MESSAGES[language]) return { language: language, of: MESSAGES[language] };
    }
    return { language: "en", of: MESSAGES.en };
  }

  function show(reason) {
    if (shown) return;
    shown = true;
    var found = texts(),
      box = document.createElement("div"),
      picture = document.createElement("img"),
      sentence = document.createElement("p");
    box.className = "closed";
    box.lang = found.language;
    picture.alt = "";
    picture.onerror = function () {
      box.removeChild(picture);
    };
    picture.src = "preview.jpg";
    sentence.setAttribute("role", "alert");
    sentence.appendChild(document.createTextNode(found.of[isFile ? "file" : reason]));
    box.appendChild(picture);
    box.appendChild(sentence);
    document.body.appendChild(box);
  }

  /* Scripts that did not load, and syntax that the browser does not know. Later errors are the page's own. */
  function onError(event) {
    var target = event.target;
    if (target && target.tagName === "SCRIPT") show("refused");
    else if (event.error && event.error.name === "SyntaxError") show("old");
  }

  function lacks() {
    if (!("noModule" in document.createElement("script"))) return true;
    for (var k = 0; k < NEEDED.length; k++) if (!window[NEEDED[k]]) return true;
    return false;
  }

  addEventListener("error", onError, true);
  addEventListener("load", function () {
    removeEventListener("error", onError, true);
  });
  var late = document.getElementById("late");
  if (late) late.parentNode.removeChild(late);
  if (isFile || lacks()) show("old");
})();
