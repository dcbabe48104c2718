// The address says what is shown, and what it says is shown.

import { parse, print, type Moment } from "./link.ts";
import type { State } from "./state.ts";

const DELAY = 150; // [ms]; browsers refuse addresses that change too often.

export interface Address {
  // Until the address says the moment, the element has `data-address`.
  write: (moment: () => Moment) => void;
  follow: () => Partial<State>;
}

export function address(policies: string[], policy: string, element: HTMLElement): Address {
  let waiting = 0;
  let last = ""; // What was last followed or written.

  function settle(): void {
    clearTimeout(waiting);
    last = location.hash;
    delete element.dataset["address"];
  }

  return {
    write: (moment) => {
      clearTimeout(waiting);
      element.dataset["address"] = "behind";
      waiting = window.setTimeout(() => {
        // An address that came meanwhile is followed, not written over.
        if (location.hash === last) history.replaceState(null, "", print(moment(), policy));
        settle();
      }, DELAY);
    },
    follow: () => {
      settle();
      const said = parse(location.hash);
      const known = (name: string | null | undefined): string | null => (name && policies.includes(name) ? name : null);
      return {
        ...{ playing: false, base: null, sim: null, t: 0, cam: "ego", stretch: 1, ghosts: true, theme: "system", beside: null, fan: null },
        ...{ ...said, policy: known(said.policy) ?? policy, against: known(said.against) },
      };
    },
  };
}
