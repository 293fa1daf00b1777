// SPDX-License-Identifier: Apache-2.0
// The search of the theme runs in a worker. Browsers refuse a worker to a page that was opened as a file. There,
// a hidden frame runs the worker's script.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      this.frame = document.createElement("iframe");
      this.frame.hidden = true;
      this.ready = new Promise((resolve) => {
        this.frame.onload = () => {
          const { contentWindow, contentDocument } = this.frame;
          contentWindow.postMessage = (data) => this.dispatchEvent(new MessageEvent("message", { data }));
          const script = contentDocument.createElement("script");
          script.src = url;
          script.onload = resolve;
          contentDocument.body.append(script);
        };
      });
      this.frame.srcdoc = "<!doctype html>";
      document.body.append(this.frame);
    }

    postMessage(data) {
      this.ready.then(() => this.frame.contentWindow.dispatchEvent(new MessageEvent("message", { data })));
    }
  };
}
