// A page that is opened as a file may not start a worker. There the search's worker runs in a hidden frame of the page.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(address) {
      super();
      this.onmessage = null;
      this.frame = document.createElement("iframe");
      this.frame.hidden = true;
      document.body.appendChild(this.frame);
      const inside = this.frame.contentWindow;
      inside.postMessage = (data) => this.answer(data);
      inside.importScripts = (...more) => more.forEach((one) => this.load(one));
      this.ready = this.load(address);
    }
    load(address) {
      return new Promise((done) => {
        const page = this.frame.contentDocument;
        const script = page.createElement("script");
        script.src = new URL(address, location.href).href;
        script.onload = done;
        script.onerror = () => this.onerror && this.onerror(new ErrorEvent("error", { message: `${address} cannot be read` }));
        page.documentElement.appendChild(script);
      });
    }
    // As between a page and a worker, what is told is copied, and heard later.
    postMessage(told) {
      const data = structuredClone(told);
      this.ready.then(() => {
        if (this.frame.contentWindow) this.frame.contentWindow.dispatchEvent(new MessageEvent("message", { data }));
      });
    }
    answer(told) {
      const event = new MessageEvent("message", { data: structuredClone(told) });
      setTimeout(() => {
        this.dispatchEvent(event);
        if (this.onmessage) this.onmessage(event);
      });
    }
    terminate() {
      this.frame.remove();
    }
  };
}
