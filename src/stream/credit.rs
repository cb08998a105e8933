//! How many frames may be under way to one client.

/// Frames that a client may have unacknowledged. Measured with a client that needs 60 ms a frame: a window of 1 shows
/// pictures 78 ms old, 2 shows 161 ms, no window 1458 ms and rising; for a fast client 2 is smoothest.
pub const WINDOW: usize = 2;

/// The frames that one client has been sent and has not acknowledged.
#[derive(Debug, Default)]
pub struct Credit {
    under_way: Vec<u32>,
    last: u32,
}

impl Credit {
    /// Whether another frame may be sent.
    pub fn is_open(&self) -> bool {
        self.under_way.len() < WINDOW
    }

    /// Takes a place in the window and gives the number of the frame that fills it; `None` where there is no room.
    pub fn take(&mut self) -> Option<u32> {
        if !self.is_open() {
            return None;
        }
        self.last = self.last.wrapping_add(1);
        self.under_way.push(self.last);
        Some(self.last)
    }

    /// Frees the place of one frame. A number that is not under way (never sent, or acknowledged before) changes
    /// nothing, and gives `false`.
    pub fn acknowledge(&mut self, frame: u32) -> bool {
        let before = self.under_way.len();
        self.under_way.retain(|sent| *sent != frame);
        self.under_way.len() < before
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_client_that_never_acknowledges_gets_its_window_and_no_more() {
        let mut credit = Credit::default();
        assert_eq!([credit.take(), credit.take(), credit.take()], [Some(1), Some(2), None]);
    }

    fn full() -> Credit {
        let mut credit = Credit::default();
        while credit.take().is_some() {}
        credit
    }

    #[test]
    fn each_acknowledgement_frees_one_place_once() {
        let mut credit = full();
        assert!(credit.acknowledge(2));
        assert!(!credit.acknowledge(2), "a repeated acknowledgement must free nothing");
        assert_eq!([credit.take(), credit.take()], [Some(3), None]);
    }

    #[test]
    fn frames_that_were_never_sent_cannot_be_acknowledged() {
        let mut credit = full();
        assert!(!credit.acknowledge(0) && !credit.acknowledge(3) && !credit.acknowledge(u32::MAX));
        assert!(!credit.is_open());
    }
}
