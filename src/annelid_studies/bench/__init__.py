"""Speed and error side by side: closed loops timed one by one, judged against converged runs."""
