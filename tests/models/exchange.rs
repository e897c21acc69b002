//! Composite steps: time passes, or a whole exchange happens.

use super::{
    action::{Answer, Exchange, Fate, Wait},
    bus::{Asked, Bus},
    names::*,
};

impl<B: Kit> Bus<B> {
    pub(super) fn wait(&mut self, wait: Wait) -> Checked {
        let timeout = self.master.poll_timeout();
        let until = match wait {
            Wait::Short => Some(self.now + Duration::from_micros(100)),
            Wait::Deadline => timeout,
            Wait::PastDeadline => timeout.map(|at| at + Duration::from_micros(1)),
            Wait::Long => Some(self.now + Duration::from_millis(10_000)),
        };
        self.now = until.map_or(self.now, |until| until.max(self.now));
        Ok(())
    }

    /// Everything up to the end of the next answered request, in one action.
    pub(super) fn exchange(&mut self, exchange: Exchange) -> Checked {
        let (fate, answer) = exchange.parts();
        let mut write_fate = Some(fate);
        for _ in 0..12 {
            match self.send(write_fate.unwrap_or(Fate::Arrives))? {
                None => match self.master.poll_timeout() {
                    Some(at) => self.now = at,
                    None => return Ok(()),
                },
                Some(is_exchange) => {
                    if fate != Fate::Lost {
                        write_fate = None; // a port that fails once
                    }
                    if is_exchange {
                        break;
                    }
                }
            }
        }
        let Some(asked) = self.asked else { return Ok(()) };
        if fate == Fate::Lost && answer.is_some() && !B::ANSWERS_WRITE {
            self.asked = Some(Asked { is_heard: true, ..asked });
        }
        if let Some(answer) = answer {
            self.answer(answer)?;
            if answer == Answer::Leftover {
                self.answer(Answer::Right)?;
            }
        }
        if self.asked.is_some() {
            self.now = self.now.max(asked.deadline);
            self.pass_time()?;
        }
        if let Some(late) = self.late.take() {
            self.hear(late.reply, self.now + Duration::from_micros(1))?;
        }
        Ok(())
    }
}
